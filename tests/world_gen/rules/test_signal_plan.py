"""Phases of the plans at drawn junctions: who drives together, for how long, who waits."""

from __future__ import annotations

from collections.abc import Mapping
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.world_gen.osm.osm_map import OsmMap
from foretwin.world_gen.rules.signal_plan import oncoming, share_green
from tests.world_gen.drawn_maps import AVENUE, CROSS, STREET, crossing, drawn_map, world_of
from tests.world_gen.plan_checks import check_plans, plan_of

COVERS = ("foretwin.world_gen.rules.signal_groups",)

LIGHT = {"highway": "traffic_signals"}


def with_turn_lanes(*letters: str) -> OsmMap:
    """Return a crossing whose roads in from these sides have a lane for left turns alone."""
    ends = {"E": 1, "N": 2, "W": 3, "S": 4}
    wide: Mapping[str, str] = {
        "lanes": "3",
        "lanes:forward": "2",
        "lanes:backward": "1",
        "turn:lanes:forward": "left|through;right",
    }
    ways = [
        (
            10 + end,
            [end, 0],
            {"highway": "secondary", "name": side} | (wide if side in letters else {}),
        )
        for side, end in ends.items()
    ]
    return drawn_map(CROSS, ways, node_tags={0: LIGHT})


def test_roads_that_face_each_other_drive_together():
    world = world_of(crossing(node_tags={0: LIGHT}))
    check_plans(world)
    plan = plan_of(world)
    assert [len(phase.green_group_ids) for phase in plan.phases] == [2, 2]
    assert len(plan.groups) == 4
    assert sum(phase.green_s + plan.amber_s + plan.all_red_s for phase in plan.phases) == 90.0
    assert plan.source == "default"
    assert all(signal.osm_nodes == (0,) for signal in world.signals)
    for signal in world.signals:
        # It looks away from the junction, and hangs beside the road out there.
        facing = np.array([np.cos(signal.yaw_rad), np.sin(signal.yaw_rad)])
        assert signal.position[:2] @ facing > 4.0
        assert 3.0 < signal.position[:2] @ [-facing[1], facing[0]] < 5.0


def test_a_busier_road_is_green_for_longer():
    wide = {"highway": "secondary", "name": "Street", "lanes": "4"}
    world = world_of(crossing(street=wide, node_tags={0: LIGHT}))
    street, avenue = sorted(phase.green_s for phase in plan_of(world).phases)[::-1]
    assert street > 1.5 * avenue


def test_turn_lanes_on_both_sides_get_a_phase_of_their_own():
    world = world_of(with_turn_lanes("E", "W"))
    check_plans(world)
    plan = plan_of(world)
    turn = {c.id: c.turn for c in world.connections}
    alone = {
        group.id
        for group in plan.groups
        if group.connection_ids and {turn[name] for name in group.connection_ids} == {"left"}
    }
    assert len(alone) == 2
    assert [set(phase.green_group_ids) for phase in plan.phases].count(alone) == 1
    assert len(plan.phases) == 3
    above = [signal for signal in world.signals if signal.id.endswith("above")]
    assert {signal.group_id for signal in above} == alone
    assert all(signal.position[2] > 5.0 for signal in above)
    middle = {lane.id: lane for lane in world.lanes}
    for signal in above:
        (lane_id,) = signal.lane_ids
        end = middle[lane_id].centerline[-1]
        assert np.hypot(*(signal.position[:2] - end)) < 1.0


def test_a_turn_lane_on_one_side_waits_for_oncoming_cars():
    world = world_of(with_turn_lanes("W"))
    check_plans(world)
    assert sorted(len(phase.green_group_ids) for phase in plan_of(world).phases) == [2, 3]


def test_fast_roads_have_longer_amber():
    fast = {"highway": "primary", "name": "Street", "maxspeed": "70"}
    slow = plan_of(world_of(crossing(node_tags={0: LIGHT})))
    assert slow.amber_s == 3.0
    assert plan_of(world_of(crossing(street=fast, node_tags={0: LIGHT}))).amber_s == 5.0


def test_those_on_foot_go_when_the_crossed_road_waits():
    osm = drawn_map(
        CROSS | {5: (-9.0, 0.0)},
        [
            (11, [0, 1], STREET),
            (12, [0, 2], AVENUE),
            (13, [3, 5, 0], STREET),
            (14, [4, 0], AVENUE),
        ],
        node_tags={0: LIGHT, 5: {"highway": "crossing", "crossing": "traffic_signals"}},
    )
    world = world_of(osm)
    check_plans(world)
    plan = plan_of(world)
    (walk,) = [group for group in plan.groups if group.crossing_ids]
    assert walk.crossing_ids == ("n5",)
    street = {
        c.signal_group_id
        for c in world.connections
        if "w13" in c.from_lane_id or "w11" in c.from_lane_id
    }
    for phase in plan.phases:
        assert (walk.id in phase.green_group_ids) != bool(street & set(phase.green_group_ids))
    line = next(line for line in world.stop_lines if "w13" in line.lane_id)
    assert line.ends[0, 0] == pytest.approx(-12.0, abs=0.2)


@given(
    parts=st.lists(st.tuples(st.integers(0, 6), st.floats(5.0, 12.0)), min_size=1, max_size=7),
    total_s=st.floats(0.0, 120.0),
)
def test_green_is_shared_out_whole(parts, total_s):
    weights, least = [weight for weight, _ in parts], [least for _, least in parts]
    shared = share_green(weights, least, total_s)
    assert all(green >= lowest for green, lowest in zip(shared, least, strict=True))
    if any(weights):
        assert sum(shared) == pytest.approx(max(total_s, sum(least)), abs=0.26)


def test_roads_face_each_other_where_each_lies_straight_ahead_of_the_other():
    def group(key, straight_ahead):
        return SimpleNamespace(approach=SimpleNamespace(key=key, opposite=straight_ahead))

    east, west = group((1, True), (2, True)), group((2, True), (1, True))
    north_west = group((3, True), (1, True))
    assert oncoming(east, west)
    assert not oncoming(east, north_west)
    assert not oncoming(north_west, east)
