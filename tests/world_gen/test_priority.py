"""Who may go at a drawn junction: stop lines, signals, give way, conflicts."""

from __future__ import annotations

import numpy as np
import pytest
from shapely.geometry import LineString

from tests.world_gen.drawn_maps import AVENUE, STREET, crossing, drawn_map, world_of


def test_stop_lines_lie_across_their_lanes():
    world = world_of(crossing())
    lanes = {lane.id: lane for lane in world.lanes}
    assert len(world.stop_lines) == 4
    for line in world.stop_lines:
        lane = lanes[line.lane_id]
        across, path = LineString(line.ends), LineString(lane.centerline)
        assert across.intersects(path)
        assert across.length == pytest.approx(lane.width_m.value, abs=0.01)
        ahead = lane.centerline[-1] - lane.centerline[-2]
        side = line.ends[0] - line.ends[1]
        assert ahead[0] * side[1] - ahead[1] * side[0] > 0.0  # first end on the left


def test_a_signal_at_its_own_stop_line_is_tagged_and_others_are_inferred():
    nodes = {5: (-12.0, 0.0), 6: (12.0, 0.0)}
    osm = drawn_map(
        {0: (0.0, 0.0), 1: (90.0, 0.0), 2: (0.0, 90.0), 3: (-90.0, 0.0), 4: (0.0, -90.0)} | nodes,
        [
            (11, [0, 6, 1], STREET),
            (12, [0, 2], AVENUE),
            (13, [3, 5, 0], STREET),
            (14, [4, 0], AVENUE),
        ],
        node_tags={
            5: {"highway": "traffic_signals", "traffic_signals:direction": "forward"},
            6: {"highway": "traffic_signals", "traffic_signals:direction": "backward"},
        },
    )
    world = world_of(osm)
    assert world.intersection.control == "signals"
    assert len(world.signals) == 4
    by_node = {signal.osm_node: signal for signal in world.signals if signal.osm_node}
    assert set(by_node) == {5, 6}
    assert by_node[5].position[0] == pytest.approx(-12.0, abs=0.2)
    assert by_node[5].position[1] < -3.0  # beside the kerb, right of the lane
    plan = world.junctions[0].plan
    assert plan is not None
    both = {by_node[5].group_id, by_node[6].group_id}
    assert [set(phase.green_group_ids) == both for phase in plan.phases].count(True) == 1
    assert len(plan.phases) == 2
    assert len({signal.group_id for signal in world.signals}) == 4
    assert {c.control for c in world.connections} == {"signal"}


def test_the_minor_road_gives_way():
    world = world_of(
        crossing(street={"highway": "primary", "name": "Main"}, avenue={"highway": "residential"})
    )
    control = {line.lane_id: line.control.value for line in world.stop_lines}
    for lane in world.lanes:
        if lane.role == "approach":
            assert control[lane.id] == ("none" if lane.name == "Main" else "give_way")
    minor = [c for c in world.connections if c.control == "give_way"]
    main_straight = [c for c in world.connections if c.control == "none" and c.turn == "straight"]
    for c in minor:
        crossed = {m.id for m in main_straight} & set(c.conflicts_with)
        assert crossed <= set(c.yields_to)


def test_each_conflict_has_one_answer():
    world = world_of(crossing())
    by_id = {c.id: c for c in world.connections}
    conflicts = 0
    for c in world.connections:
        for other in c.conflicts_with:
            conflicts += 1
            assert c.id in by_id[other].conflicts_with
            assert (other in c.yields_to) != (c.id in by_id[other].yields_to)
    assert conflicts > 0


def test_who_comes_from_the_right_goes_first_and_left_turns_wait():
    world = world_of(crossing())
    start = {lane.id: lane.centerline[0] for lane in world.lanes}

    def find(side, turn):
        return next(
            c
            for c in world.connections
            if c.turn == turn and np.dot(start[c.from_lane_id], side) > 50.0
        )

    west, south, east = (-1.0, 0.0), (0.0, -1.0), (1.0, 0.0)
    assert find(south, "straight").id in find(west, "straight").yields_to
    assert find(east, "straight").id in find(west, "left").yields_to
