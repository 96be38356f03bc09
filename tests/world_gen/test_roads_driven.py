"""The roads between two lanes, as a check of paths needs them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from foretwin.world_gen.roads.build_graph import build_road_graph
from tests.world_gen.drawn_maps import CROSS, drawn_map, roundabout, world_of
from tests.world_gen.lanes.test_past_driveways import beside
from tests.world_gen.measure_turns import ALLOWED_RAD, beside_m, turns_of
from tests.world_gen.roads_driven import RoadsDriven

ROAD = {"highway": "residential", "lanes": "2"}
ASIDE = drawn_map(
    {
        1: (-80.0, -3.0), 7: (-5.0, -3.0), 2: (0.0, 0.0), 3: (0.0, 14.0), 4: (80.0, 14.0),
        5: (0.0, -80.0), 6: (0.0, 90.0),
    },
    [(10, (1, 7, 2), ROAD), (20, (5, 2, 3, 6), ROAD), (30, (3, 4), ROAD)],
)  # fmt: skip
"""A crossing whose eastern arm lies 14 m north of its western one, which bends at the end."""


def bearings_deg(start_way: int, end_way: int) -> list[float]:
    world = world_of(ASIDE)
    roads = RoadsDriven(build_road_graph(ASIDE), world.frame)
    lanes = {lane.id: lane for lane in world.lanes}
    (one,) = (
        c
        for c in world.connections
        if c.from_lane_id.startswith(f"w{start_way}.") and c.to_lane_id.startswith(f"w{end_way}.")
    )
    found = roads.directions(lanes[one.from_lane_id], lanes[one.to_lane_id])
    return [round(math.degrees(math.atan2(north, east))) % 360 for east, north in found]


def test_who_crosses_where_arms_lie_aside_drives_along_the_road_between() -> None:
    assert bearings_deg(10, 30) == [0, 31, 90, 0]
    assert bearings_deg(30, 10) == [180, 270, 211, 180]


def test_roads_lie_where_the_lanes_of_a_world_end() -> None:
    far = {i: (x + 500.0, y - 300.0) for i, (x, y) in CROSS.items()}
    osm = drawn_map(far, [(11, [0, 1], ROAD), (12, [0, 2], ROAD), (13, [3, 0], ROAD)])
    world = world_of(osm)
    roads = RoadsDriven(build_road_graph(osm), world.frame)
    lanes = {lane.id: lane for lane in world.lanes}
    for c in world.connections:
        start, end = lanes[c.from_lane_id], lanes[c.to_lane_id]
        before, behind = roads.lines(start, end)
        assert math.dist(before[0], start.centerline[-1]) < 2.0
        assert math.dist(behind[-1], end.centerline[0]) < 2.0


def test_turns_by_a_ring_are_of_a_kind_of_their_own() -> None:
    kinds = {}
    for osm in (ASIDE, roundabout()):
        world = world_of(osm)
        turns = list(turns_of(world, RoadsDriven(build_road_graph(osm), world.frame)))
        kinds[osm is ASIDE] = {t.kind for t in turns}
    assert kinds == {True: {"turn"}, False: {"ring"}}


def test_a_road_that_goes_on_past_driveways_is_found_whole() -> None:
    osm = beside(12.0)
    world = world_of(osm)
    roads = RoadsDriven(build_road_graph(osm), world.frame)
    lanes = {lane.id: lane for lane in world.lanes}
    (one,) = (c for c in world.connections if c.id.startswith("w13.") and ">w11." in c.id)
    end = lanes[one.to_lane_id]
    _, behind = roads.lines(lanes[one.from_lane_id], end)

    assert end.id.startswith("w11.0.1.")
    assert math.dist(behind[-1], end.centerline[0]) < 2.0


def test_such_a_turn_leaves_the_angle_of_its_lanes_and_not_that_of_its_roads() -> None:
    world = world_of(ASIDE)
    turns = turns_of(world, RoadsDriven(build_road_graph(ASIDE), world.frame))
    across = [t for t in turns if t.name.startswith("w10.") and ">w30." in t.name]

    assert across[0].left_rad > ALLOWED_RAD
    assert across[0].left_roads_rad == pytest.approx(0.0, abs=0.02)


def test_who_turns_between_roads_stays_in_what_they_span_and_who_swings_out_does_not() -> None:
    east, north = np.array([1.0, 0.0]), np.array([0.0, 1.0])
    roads = [np.array([[-20.0, 0.0], [0.0, 0.0]]), np.array([[0.0, 0.0], [0.0, 20.0]])]
    cut = np.array([[-20.0, 0.0], [-6.0, 6.0], [0.0, 20.0]])
    swung = np.array([[-20.0, -2.0], [3.0, -2.0], [7.0, 0.0], [2.0, 20.0]])

    assert beside_m(cut, east, north, roads) == pytest.approx(0.0)
    # The corner where its lanes' lines cross lies at (2, -2).
    assert beside_m(swung, east, north, roads) == pytest.approx(5.0 - 2.0, abs=0.2)
    assert math.isnan(beside_m(cut, east, north, [*roads, roads[0]]))
    # Lanes side by side have no such corner, and what the roads span is all.
    assert beside_m(np.concatenate(roads), east, east, roads) == pytest.approx(0.0)
