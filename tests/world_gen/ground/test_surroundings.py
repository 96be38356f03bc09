"""What lies on the ground of a World: every part in its place, and none on another."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest
import shapely

from foretwin.contracts.codec import content_bytes
from foretwin.contracts.world import Area, World
from tests.world_gen.drawn_maps import STREET, crossing, roundabout, world_of

COVERS = (
    "foretwin.world_gen.ground.crossings",
    "foretwin.world_gen.ground.islands",
    "foretwin.world_gen.ground.sidewalks",
    "foretwin.world_gen.polygon_areas",
)


def covered(areas: tuple[Area, ...]) -> shapely.Geometry:
    return shapely.union_all([shapely.Polygon(a.outline, a.holes) for a in areas])


@pytest.fixture(scope="module")
def world() -> World:
    square = {30: (40.0, -6.0), 31: (46.0, -6.0), 32: (46.0, 0.0), 33: (40.0, 0.0)}
    return world_of(
        crossing(
            street=STREET | {"sidewalk": "both"},
            extra_nodes=square | {40: (60.0, 0.0), 41: (20.0, 0.0)},
            extra_ways=[
                (30, [30, 31, 32, 33, 30], {"area:highway": "traffic_island"}),
                (15, [0, 41, 40], STREET | {"sidewalk": "both"}),
            ],
            node_tags={41: {"highway": "crossing", "crossing:signals": "yes"}},
        )
    )


def test_cars_drive_on_paved_ground_alone(world):
    ground = covered(world.road_surface).buffer(0.02)
    for way in (*world.lanes, *world.connections):
        assert ground.contains(shapely.LineString(way.centerline).buffer(0.8, cap_style="flat"))


def test_sidewalks_lie_beside_the_road(world):
    walks, ground = covered(world.sidewalks), covered(world.road_surface)
    assert walks.area > 100.0
    assert walks.intersection(ground).area < 0.1
    assert walks.distance(ground) < 0.01


def test_a_crossing_leads_from_kerb_to_kerb(world):
    (found,) = world.crossings
    assert (found.id, found.kind.value, found.kind.source) == ("n41", "traffic_signals", "tagged")
    ends = shapely.points(found.line)
    assert shapely.distance(ends, covered(world.road_surface).boundary) == pytest.approx(
        0, abs=0.01
    )


def test_islands_are_not_driven_on(world):
    (mapped,) = world.islands
    ring = world_of(roundabout())
    (middle,) = ring.islands
    assert (mapped.id, mapped.source) == ("island:traffic:w30", "tagged")
    assert (middle.id.rpartition(":")[0], middle.source) == ("island:ring", "inferred")
    for island, drawn in ((mapped, world), (middle, ring)):
        for way in (*drawn.lanes, *drawn.connections):
            path = shapely.LineString(way.centerline).buffer(0.9, cap_style="flat")
            assert path.intersection(shapely.Polygon(island.outline)).area < 0.01


def test_areas_are_on_the_grid_and_turn_counter_clockwise(world):
    for area in (*world.road_surface, *world.sidewalks, *world.islands):
        assert np.array_equal(area.outline, np.round(area.outline, 3))
        assert shapely.Polygon(area.outline).is_valid
        assert shapely.is_ccw(shapely.LinearRing(area.outline))


def test_an_arm_that_is_wider_than_the_ring_does_not_pave_its_middle():
    ground = covered(world_of(roundabout()).road_surface)
    # The ring's middle line is at 15 m, and it is 4.5 m wide.
    assert ground.intersection(shapely.Point(0.0, 0.0).buffer(12.5)).area < 0.01


def beside_a_house(**tags: str) -> World:
    """A house that reaches 1 m into a street of these tags, whose edge is at 3 m."""
    return world_of(
        crossing(
            street=STREET | tags,
            extra_nodes={20: (30.0, -2.0), 21: (50.0, -2.0), 22: (50.0, -20.0), 23: (30.0, -20.0)},
            extra_ways=[(20, [20, 21, 22, 23, 20], {"building": "yes", "building:levels": "2"})],
        )
    )


def test_what_a_building_has_in_the_way_is_told_but_where_the_road_leads_through_it():
    (area,) = beside_a_house().cut_away
    assert area.id == "w20"
    west, south, east, north = shapely.Polygon(area.outline).bounds
    assert (west, south, east, north) == pytest.approx((30.0, -3.0, 50.0, -2.0), abs=0.05)
    for tags in ({"covered": "yes"}, {"tunnel": "building_passage"}, {"layer": "-1"}):
        assert beside_a_house(**tags).cut_away is msgspec.UNSET
    assert b"cut_away" not in content_bytes(world_of(crossing()))
