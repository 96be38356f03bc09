"""Ramps begin beside the road that they leave, though maps draw them from its middle."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from foretwin.contracts.world import World
from foretwin.world_gen.build import build_region
from foretwin.world_gen.roads.build_graph import build_road_graph
from tests.world_gen.drawn_maps import drawn_map

MOTORWAY = {"highway": "motorway", "oneway": "yes", "lanes": "2", "name": "A 1"}
RAMP = {"highway": "motorway_link", "oneway": "yes", "lanes": "1"}


def _motorway(angle_deg: float, *, merges: bool = False, ramp_m: float = 250.0) -> World:
    """Return a motorway eastward (ways 1, 2), and a ramp (3) that leaves or joins it at node 2."""
    bend = math.radians(angle_deg)
    end = ramp_m * math.cos(bend), -ramp_m * math.sin(bend)
    nodes = {1: (-250.0, 0.0), 2: (0.0, 0.0), 3: (250.0, 0.0), 4: end}
    lines = [(1, [1, 2], MOTORWAY), (2, [2, 3], MOTORWAY), (3, [2, 4], RAMP)]
    ways = [(i, line[::-1] if merges else line, tags) for i, line, tags in lines]
    osm = drawn_map(nodes, ways)
    return build_region(osm, build_road_graph(osm), osm.bounds, ground=False)


def _strips(world: World, way: int) -> list[shapely.Polygon]:
    return [
        shapely.buffer(
            shapely.LineString(lane.centerline), lane.width_m.value / 2, cap_style="flat"
        )
        for lane in world.lanes
        if lane.osm_way == way
    ]


def _shared_m2(world: World) -> float:
    roads = [shapely.union_all(_strips(world, way)) for way in (2, 3)]
    return float(shapely.area(shapely.intersection(*roads)))


@settings(max_examples=15)
@given(st.floats(3.0, 40.0), st.booleans())
def test_no_ramp_lies_in_the_road_that_it_leaves_or_joins(angle_deg, merges):
    world = _motorway(angle_deg, merges=merges)
    assert _shared_m2(world) < 0.5
    assert _strips(world, 3), "the ramp has a lane"
    assert any("w3." in c.from_lane_id + c.to_lane_id for c in world.connections)


def test_the_way_to_a_flat_ramp_is_driven_without_a_jerk():
    world = _motorway(4.0)
    (onto,) = [c for c in world.connections if c.to_lane_id.startswith("w3.")]
    steps = np.diff(onto.centerline, axis=0)
    heading = np.arctan2(steps[:, 1], steps[:, 0])
    assert len(onto.centerline) > 2
    assert heading.max() < 0.01, "it turns to no side but that of the ramp"
    assert heading.min() > -math.radians(2.5 * 4.0)


def test_the_road_itself_keeps_its_lanes():
    bare, flat = _motorway(40.0), _motorway(3.0)
    begin = [min(s.bounds[0] for s in _strips(world, 2)) for world in (bare, flat)]
    assert begin[1] < 31.0
    ramp = [min(s.bounds[0] for s in _strips(flat, 3))]
    assert ramp[0] > 90.0, "7 m aside at 3 degrees"
    assert begin[0] < begin[1]


def test_a_ramp_that_ends_within_the_road_gives_way_as_far_as_a_lane_may():
    (lane,) = _strips(_motorway(3.0, ramp_m=60.0), 3)
    assert lane.bounds[2] - lane.bounds[0] == pytest.approx(0.2 * 60.0, abs=1.0)


@pytest.mark.parametrize("merges", [False, True])
def test_a_street_that_parts_steeply_is_cut_at_the_kerb(merges):
    world = _motorway(60.0, merges=merges)
    (lane,), road = _strips(world, 3), shapely.union_all(_strips(world, 2))
    assert 0.0 < shapely.distance(lane, road) < 8.0
