"""Road users keep their speed, brake, follow, stop at red and wait, as each is meant to."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from foretwin.sim_worker.road_users.crowd import EgoBoxes
from tests.sim_worker.road_users.crossroads import centre_arc, crossroads, run, straight_on, traffic

COVERS = ("foretwin.sim_worker.road_users.crowd",)

EAST, NORTH = (1.0, 0.0), (0.0, 1.0)


def test_who_heeds_nobody_keeps_the_speed(tmp_path: Path) -> None:
    world = crossroads(tmp_path)
    east = straight_on(world, EAST)
    moving = traffic(world, [east], before_m=[40.0], speed_mps=[10.0], lawful=[False])
    found = run(moving, seconds=3.0)
    assert found[-1, 0] == pytest.approx([centre_arc(east) - 10.0, 10.0], abs=1e-9)


def test_who_is_to_brake_stops_in_the_distance_that_takes(tmp_path: Path) -> None:
    world = crossroads(tmp_path)
    east = straight_on(world, EAST)
    moving = traffic(
        world, [east], before_m=[60.0], speed_mps=[10.0], lawful=[False], brakes_at_s=1.0
    )
    found = run(moving, seconds=5.0)
    # 10 m at speed, then v² / (2 a).
    assert found[-1, 0] == pytest.approx([centre_arc(east) - 60.0 + 10.0 + 12.5, 0.0], abs=0.02)


def test_a_follower_keeps_its_distance_and_stops_behind(tmp_path: Path) -> None:
    world = crossroads(tmp_path)
    east = straight_on(world, EAST)
    moving = traffic(
        world, [east, east], before_m=[60.0, 90.0], speed_mps=[0.0, 10.0], lawful=[False, True]
    )
    found = run(moving, seconds=12.0)
    gap = found[:, 0, 0] - found[:, 1, 0] - 4.5
    assert gap.min() > 1.0
    assert found[-1, 1, 1] == pytest.approx(0.0, abs=0.3)
    assert gap[-1] < 4.0


def test_a_standing_ego_is_not_run_over(tmp_path: Path) -> None:
    world = crossroads(tmp_path)
    east = straight_on(world, EAST)
    place = centre_arc(east) - 30.0
    pose = east.pose_at(np.array([place]))
    ego = EgoBoxes(
        np.column_stack([pose.xy_m, pose.yaw_rad]), np.zeros(1), 0, np.array([place]), 4.5, 1.8
    )
    moving = traffic(world, [east], before_m=[90.0], speed_mps=[10.0], lawful=[True])
    found = run(moving, seconds=15.0, ego=ego)
    assert place - found[-1, 0, 0] - 4.5 == pytest.approx(2.0, abs=1.0)


def test_who_has_others_on_the_right_waits_and_then_goes(tmp_path: Path) -> None:
    world = crossroads(tmp_path)
    east, north = straight_on(world, EAST), straight_on(world, NORTH)
    moving = traffic(
        world, [east, north], before_m=[40.0, 45.0], speed_mps=[8.0, 8.0], lawful=[True, True]
    )
    found = run(moving, seconds=14.0)
    centres = centre_arc(east), centre_arc(north)
    passes = [np.argmax(found[:, r, 0] > centres[r]) for r in (0, 1)]
    assert 0 < passes[1] < passes[0]
    assert found[:, 1, 1].min() > 6.0, "who has priority goes on"
    both = (np.abs(found[:, :, 0] - centres) < 4.0).all(axis=1)
    assert not both.any(), "never both in the middle"


def test_red_is_waited_for_and_green_lets_go(tmp_path: Path) -> None:
    world = crossroads(tmp_path)
    east = straight_on(world, EAST)
    line = centre_arc(east) - 10.0
    moving = traffic(world, [east], before_m=[60.0], speed_mps=[10.0], lawful=[True])
    waiting = run(moving, seconds=12.0, red_arcs_m=np.array([[line]]))
    front = waiting[:, 0, 0] + 2.25
    assert front.max() < line
    assert front[-1] > line - 4.0
    going = run(moving, seconds=4.0)
    assert going[-1, 0, 0] > line


def test_who_is_not_there_is_nowhere(tmp_path: Path) -> None:
    world = crossroads(tmp_path)
    east = straight_on(world, EAST)
    moving = traffic(
        world, [east, east], before_m=[60.0, 20.0], speed_mps=[5.0, 5.0], lawful=[True] * 2,
        present=[True, False],
    )  # fmt: skip
    run(moving, seconds=2.0)
    assert np.isnan(moving.poses[0, 1]).all()
    assert moving.speed_mps[0, 0] > 5.0, "nobody is ahead"
