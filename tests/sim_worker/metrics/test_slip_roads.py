"""A slip road's own sign: road users wait by it, and who does not breaks the right of way."""

from __future__ import annotations

import functools

import numpy as np

from foretwin.contracts.world import Connection, World
from foretwin.sim_worker.metrics.evaluation import evaluate
from foretwin.sim_worker.metrics.ground import DrivableGround
from foretwin.sim_worker.metrics.rollout import Context
from foretwin.sim_worker.metrics.route_rules import RouteRules
from foretwin.sim_worker.road_users.right_of_way import JunctionRules
from tests.sim_worker.metrics.motions import Mover, rollout, times
from tests.sim_worker.road_users.crossroads import path_of
from tests.world_gen.slip_roads import lines_inside, slip_world

SPEED_MPS = 10.0


@functools.cache
def place() -> tuple[World, Connection, Connection]:
    """Return a World, its slip road, and the way straight on that it joins."""
    world = slip_world()
    ((_, slip),) = lines_inside(world)
    through = next(
        c for c in world.connections if c.turn == "straight" and c.to_lane_id == slip.to_lane_id
    )
    return world, slip, through


def test_road_users_on_the_slip_road_wait_behind_its_line_and_at_no_light() -> None:
    world, slip, through = place()
    rules = JunctionRules(world)
    mine, theirs = path_of(world, slip), path_of(world, through)
    found = rules.between([rules.taken(mine), rules.taken(theirs)])
    ((line, _),) = lines_inside(world)
    line_arc_m = float(mine.locate(line.ends.mean(axis=0)[None]).arc_m[0])
    assert found.meetings[0, 1, 0] > line_arc_m
    assert np.isnan(found.meetings[1, 0]).all()
    assert np.isinf(found.stop_arcs_m[0]).all()


def test_a_path_over_the_slip_road_knows_its_line() -> None:
    world, slip, through = place()
    ((line, _),) = lines_inside(world)
    mine = {ahead.line_id: ahead for ahead in RouteRules(world, path_of(world, slip)).lines}
    assert (mine[line.id].control, mine[line.id].group_id) == ("give_way", None)
    assert {ahead.group_id for ahead in mine.values()} == {None}
    others = RouteRules(world, path_of(world, through)).lines
    assert line.id not in {ahead.line_id for ahead in others}


def test_who_leaves_the_slip_road_in_front_of_others_breaks_the_right_of_way() -> None:
    assert violations(gap_m=4.0) == 1.0
    assert violations(gap_m=80.0) == 0.0


def violations(gap_m: float) -> float:
    """Return the violations of an ego that does not wait, others so far before the merging."""
    world, slip, through = place()
    mine, theirs = path_of(world, slip), path_of(world, through)
    (conflict,) = [c for c in world.conflicts if slip.id in (c.first_id, c.second_id)]
    merge_m = float(mine.locate(conflict.area).arc_m.min())
    time_s = times()
    pose = mine.pose_at(merge_m - 20.0 + SPEED_MPS * time_s)
    ego = np.column_stack([pose.xy_m, pose.yaw_rad])
    # On the straight road whoever has priority is so far away when the ego merges.
    start_m = float(theirs.locate(conflict.area).arc_m.min()) - gap_m - 2.0 * SPEED_MPS
    start = theirs.pose_at(np.array([start_m - 2.0]))
    (x, y), yaw = start.xy_m[0], float(start.yaw_rad[0])
    context = Context(path=mine, ground=DrivableGround(world), rules=RouteRules(world, mine))
    driven = rollout(ego, Mover(x, y, yaw, SPEED_MPS))
    name = "right_of_way_violations"
    return float(evaluate(driven, (name,), context=context)[name].values[0])
