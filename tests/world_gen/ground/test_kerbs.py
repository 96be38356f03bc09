"""Kerbs run along the edge of the paved ground, and nowhere across the way of a car."""

from __future__ import annotations

from pathlib import Path

import pytest
import shapely

import foretwin
from foretwin.contracts.world import World
from tests.world_gen.drawn_maps import CROSS, STREET, crossing, drawn_map, roundabout, world_of

ARM_WIDTH_M = 6.0
"""Of two residential lanes."""


def paved(world: World) -> shapely.Geometry:
    return shapely.union_all([shapely.Polygon(a.outline, a.holes) for a in world.road_surface])


def kerbs(world: World) -> shapely.MultiLineString:
    return shapely.MultiLineString([line.tolist() for line in world.kerbs])


def test_kerbs_are_the_edge_of_the_paved_ground_but_for_where_roads_end():
    world = world_of(crossing())
    edge = paved(world).boundary
    assert kerbs(world).length == pytest.approx(edge.length - 4 * ARM_WIDTH_M, abs=0.2)
    assert edge.buffer(0.01).contains(kerbs(world))


@pytest.mark.parametrize("osm", [crossing(), roundabout()], ids=["crossing", "roundabout"])
def test_no_kerb_stands_in_the_way(osm):
    world = world_of(osm)
    ways = [*world.lanes, *world.connections]
    swept = shapely.buffer([shapely.LineString(w.centerline) for w in ways], 0.9, cap_style="flat")
    assert not shapely.intersects(swept, kerbs(world)).any()


def test_a_bridge_and_the_road_below_it_keep_their_kerbs():
    bridge = {"highway": "primary", "bridge": "yes", "layer": "1"}
    below = drawn_map(
        CROSS | {30: (50.0, -60.0), 31: (50.0, 60.0)},
        [(11, [3, 0, 1], STREET), (12, [4, 0, 2], STREET), (30, [30, 31], bridge)],
    )
    under = kerbs(world_of(below)).intersection(shapely.box(46.0, -4.0, 54.0, 4.0))
    assert under.length == pytest.approx(4 * 8.0, abs=0.01)  # two edges of each road go through


@pytest.mark.real_data
def test_no_kerb_of_a_real_ring_stands_within_the_paved_ground(data_dir: Path):
    town = foretwin.open_map(data_dir / "osm-badhersfeld/badhersfeld.osm.xml.gz")
    world = town.world("n1900410660")  # roads of its arms meet the ring between two mouths
    edge = paved(world).boundary
    assert kerbs(world).difference(edge.buffer(0.15)).length < 0.1
    # But for where roads end: beside the stretches of a ring as beside those that lead into it.
    assert edge.difference(kerbs(world).buffer(0.15)).length < 40.0
