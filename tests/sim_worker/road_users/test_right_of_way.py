"""Who waits for whom, read from a World for any set of paths."""

from __future__ import annotations

from pathlib import Path

import msgspec
import numpy as np
import pytest

from foretwin.sim_worker.road_users.right_of_way import JunctionRules
from tests.sim_worker.road_users.crossroads import centre_arc, crossroads, path_of, straight_on

EAST, NORTH = (1.0, 0.0), (0.0, 1.0)


def test_a_path_knows_its_connections_and_nothing_else(tmp_path: Path) -> None:
    world = crossroads(tmp_path)
    rules = JunctionRules(world)
    for connection in world.connections:
        taken = rules.taken(path_of(world, connection))
        assert [one.connection.id for one in taken] == [connection.id]


def test_right_before_left_makes_one_wait_where_both_paths_cross(tmp_path: Path) -> None:
    world = crossroads(tmp_path)
    rules = JunctionRules(world)
    # Who drives east has those who drive north on the right.
    east, north = straight_on(world, EAST), straight_on(world, NORTH)
    found = rules.between([rules.taken(east), rules.taken(north)]).meetings
    wait_in, wait_out, go_in, go_out = found[0, 1]
    assert wait_in < centre_arc(east) + 1.75 < wait_out
    assert go_in < centre_arc(north) - 1.75 < go_out
    assert np.isnan(found[1, 0]).all()
    assert np.isnan(found[0, 0]).all()


def test_lights_rule_instead_and_give_stop_lines(tmp_path: Path) -> None:
    world = crossroads(tmp_path, centre={"highway": "traffic_signals"})
    rules = JunctionRules(world)
    east, north = straight_on(world, EAST), straight_on(world, NORTH)
    found = rules.between([rules.taken(east), rules.taken(north)])
    assert np.isnan(found.meetings).all()
    assert len(found.groups) == 2
    red = found.red({found.groups[found.stop_groups[0, 0]]: "red"})
    assert red[0, 0] < centre_arc(east)
    assert np.isinf(red[1]).all()


@pytest.mark.parametrize("colour", ["green", "dark", "unknown"])
def test_only_red_and_amber_stop(tmp_path: Path, colour: str) -> None:
    world = crossroads(tmp_path, centre={"highway": "traffic_signals"})
    rules = JunctionRules(world)
    found = rules.between([rules.taken(straight_on(world, EAST))])
    assert np.isinf(found.red(dict.fromkeys(found.groups, colour))).all()  # type: ignore[arg-type]


def test_ground_whose_outline_crosses_itself_is_shared_as_well(tmp_path: Path) -> None:
    world = crossroads(tmp_path)
    bow = np.array([[-3.0, -3.0], [3.0, 3.0], [3.0, -3.0], [-3.0, 3.0]])
    crossed = tuple(
        msgspec.structs.replace(one, area=one.area.mean(axis=0) + bow) for one in world.conflicts
    )
    rules = JunctionRules(msgspec.structs.replace(world, conflicts=crossed))
    east, north = straight_on(world, EAST), straight_on(world, NORTH)
    found = rules.between([rules.taken(east), rules.taken(north)]).meetings
    assert np.isfinite(found[0, 1]).all()


def test_open_ground_has_no_rules() -> None:
    rules = JunctionRules(None)
    assert rules.between([(), ()]).groups == ()


def test_ground_that_others_need_says_who_waits_and_which_way_they_cross(tmp_path: Path) -> None:
    world = crossroads(tmp_path)
    rules = JunctionRules(world)
    east = straight_on(world, EAST)
    ground = rules.ground(rules.taken(east), east)
    assert ground is not None
    assert ground.their_yaw_rad is not None
    assert (np.diff(ground.enter_arc_m) >= 0.0).all()
    assert (ground.leave_arc_m > ground.enter_arc_m).all()
    northbound = np.abs(ground.their_yaw_rad - np.pi / 2) < 0.1
    southbound = np.abs(ground.their_yaw_rad + np.pi / 2) < 0.1
    # Right before left: who comes from the right has priority, who comes from the left has not.
    assert ground.waits[northbound].tolist() == [True]
    assert ground.waits[southbound].tolist() == [False]
    assert ground.point_m[northbound][0] == pytest.approx([1.75, -1.75], abs=1.0)
