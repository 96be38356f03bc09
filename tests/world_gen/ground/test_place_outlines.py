"""Simple places are paved from mouth to mouth; others by what their turns sweep."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.geometry import LineString, Polygon

from foretwin.world_gen.ground import road_surface
from foretwin.world_gen.ground.place_outlines import PlaceOutlines
from tests.world_gen.drawn_maps import GERMANY, crossing, drawn_map, world_of


def place_of(world) -> Polygon:
    (area,) = [a for a in world.road_surface if a.id == "road:0:0"]
    return Polygon(area.outline, area.holes)


def star(bearings_deg):
    nodes = {0: (0.0, 0.0)}
    ways = []
    for i, bearing in enumerate(bearings_deg, start=1):
        angle = math.radians(bearing)
        nodes[i] = (100.0 * math.cos(angle), 100.0 * math.sin(angle))
        ways.append((10 + i, [0, i], {"highway": "residential", "name": f"Arm {i}"}))
    return drawn_map(nodes, ways, origin=GERMANY)


def test_a_crossing_has_four_straight_mouths_and_four_round_corners():
    place = place_of(world_of(crossing()))
    mouths = [6.0, 6.0, 6.0, 6.0]  # two residential lanes of 3 m
    steps = np.hypot(*np.diff(np.array(place.exterior.coords), axis=0).T)
    assert np.sort(steps)[-4:] == pytest.approx(mouths, abs=0.01)
    assert place.is_valid
    # A square corner would leave 4 squares of the corner's length out of the cross.
    assert place.area > Polygon([(-3, -3), (3, -3), (3, 3), (-3, 3)]).area


@settings(max_examples=25, deadline=None)
@given(st.lists(st.integers(0, 11), min_size=3, max_size=5, unique=True))
def test_cars_stay_on_the_paved_ground(twelfths):
    world = world_of(star([30.0 * k for k in sorted(twelfths)]))
    place = place_of(world).buffer(0.05)
    for connection in world.connections:
        path = LineString(connection.centerline)
        middle = LineString([path.interpolate(s, normalized=True) for s in (0.2, 0.4, 0.6, 0.8)])
        assert place.contains(middle.buffer(0.9, cap_style="flat"))


def test_the_outline_is_about_what_is_swept(monkeypatch):
    quick = place_of(world_of(crossing()))
    monkeypatch.setattr(
        road_surface, "simple_outlines", lambda *_: PlaceOutlines((), np.array([], dtype=object))
    )
    general = place_of(world_of(crossing()))
    assert quick.symmetric_difference(general).area < 0.12 * general.area
