"""What the law-abiding choose: within what a vehicle can, in bends and before lights."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from foretwin.contracts.arrays import Array
from foretwin.contracts.world import World
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.sim_worker import driver_model as driver
from tests.sim_worker.road_users.crossroads import (
    FAR_EGO,
    centre_arc,
    crossroads,
    path_of,
    run,
    straight_on,
    traffic,
)
from tests.sim_worker.road_users.test_paces import hook

EAST = (1.0, 0.0)


def across_mps2(path: FrenetPath, seen: Array) -> Array:
    """Return accelerations across of one road user, from its places and speeds (T, 2)."""
    yaw = path.pose_at(seen[:, 0]).yaw_rad
    return np.diff(yaw) / 0.05 * (seen[1:, 1] + seen[:-1, 1]) / 2.0


@pytest.mark.parametrize("radius_m", [4.0, 8.0, 15.0])
def test_a_hook_is_slowed_down_for_and_left_with_the_old_speed(
    tmp_path: Path, radius_m: float
) -> None:
    path = hook(radius_m, math.radians(90.0)).eased
    moving = traffic(crossroads(tmp_path), [path], before_m=[0.0], speed_mps=[13.0], lawful=[True])
    moving.arc_m[:] = -19.0
    seen = run(moving, seconds=25.0)[:, 0]
    accel = np.diff(seen[:, 1]) / 0.05
    assert np.abs(across_mps2(path, seen)).max() <= 1.1 * driver.LATERAL_ACCEL_MPS2
    assert accel.min() >= -1.5 * driver.BEND_DECEL_MPS2
    assert seen[-1, 1] > 12.0


def test_a_light_that_turns_too_late_is_passed_and_another_stopped_at(tmp_path: Path) -> None:
    world = crossroads(tmp_path)
    east = straight_on(world, EAST)
    needs_m = 10.0**2 / (2.0 * driver.LINE_DECEL_MPS2)
    for spare_m, passes in ((-1.5, True), (3.0, False)):
        line = centre_arc(east) - 20.0
        before = 20.0 + 2.25 + needs_m + spare_m
        moving = traffic(world, [east], before_m=[before], speed_mps=[10.0], lawful=[True])
        seen = run(moving, seconds=8.0, red_arcs_m=np.array([[line]]))[:, 0]
        assert (seen[-1, 0] + 2.25 > line) == passes
        assert np.diff(seen[:, 1]).min() / 0.05 >= -driver.EMERGENCY_DECEL_MPS2 - 1e-9


@pytest.mark.parametrize("watches", [True, False])
def test_who_watches_lights_sees_red_at_once_and_green_late(tmp_path: Path, watches: bool) -> None:
    """With 0.8 s of reaction: red comes after 2 s, green after 12 s."""
    world = crossroads(tmp_path)
    east = straight_on(world, EAST)
    moving = traffic(world, [east], before_m=[52.0], speed_mps=[8.0], lawful=[True], reaction_s=0.8)
    line, speeds = np.array([[centre_arc(east) - 20.0]]), []
    for tick in range(280):
        if tick % 4 == 0:
            shows_red = 40 <= tick < 240
            moving.decide(
                FAR_EGO, line if shows_red else np.full((1, 1), np.inf), watch_lights=watches
            )
        moving.step(time_s=tick * 0.05, dt_s=0.05)
        speeds.append(float(moving.speed_mps[0, 0]))
    braking = next(tick for tick in range(40, 240) if speeds[tick] < speeds[39] - 1e-3)
    assert braking == (40 if watches else 40 + 16)
    assert max(speeds[200:240]) < 0.45
    setting_off = next(tick for tick in range(240, 280) if speeds[tick] > 0.45)
    assert 240 + 16 <= setting_off <= 240 + 24


def test_nobody_brakes_harder_than_tyres_do_however_late_it_sees_who_stands(tmp_path: Path) -> None:
    world = crossroads(tmp_path)
    east = straight_on(world, EAST)
    moving = traffic(
        world, [east, east], before_m=[40.0, 50.0], speed_mps=[0.0, 16.0], lawful=[False, True]
    )
    seen = run(moving, seconds=4.0)[:, 1]
    hardest = np.diff(seen[:, 1]).min() / 0.05
    assert hardest == pytest.approx(-driver.EMERGENCY_DECEL_MPS2, abs=1e-6)


def followed(world: World, *, gap_m: float, leader_mps: float, seconds: float) -> tuple[Array, ...]:
    """Gap and speed of a follower, which first has 8 m/s, as it wants, behind a steady leader."""
    east = straight_on(world, EAST)
    moving = traffic(
        world,
        [east, east],
        before_m=[90.0, 94.5 + gap_m],
        speed_mps=[leader_mps, 8.0],
        lawful=[False, True],
    )
    seen = run(moving, seconds=seconds)
    return seen[:, 0, 0] - seen[:, 1, 0] - 4.5, seen[:, 1, 1]


WANTED_M = driver.STANDSTILL_GAP_M + 8.0 * 1.2


@pytest.mark.parametrize(
    ("gap_m", "kept_m"),
    [
        (WANTED_M, WANTED_M),
        (0.6 * WANTED_M, 0.6 * WANTED_M),
        (0.2 * WANTED_M, driver.OTHERS_CLOSEST * WANTED_M),
    ],
)
def test_who_is_first_seen_to_follow_closely_goes_on_doing_so(
    tmp_path: Path, gap_m: float, kept_m: float
) -> None:
    gap, _ = followed(crossroads(tmp_path), gap_m=gap_m, leader_mps=8.0, seconds=14.0)
    assert gap[-1] == pytest.approx(kept_m, rel=0.05)


def test_who_has_caught_up_wants_to_be_faster_and_who_is_far_behind_does_not(
    tmp_path: Path,
) -> None:
    world = crossroads(tmp_path)
    for gap_m, keeps_up in ((WANTED_M, True), (2.5 * WANTED_M, False)):
        _, speed = followed(world, gap_m=gap_m, leader_mps=8.9, seconds=10.0)
        assert (speed[-1] > 8.5) == keeps_up


def test_who_closes_in_on_another_has_not_shown_what_it_keeps(tmp_path: Path) -> None:
    gap, _ = followed(crossroads(tmp_path), gap_m=0.6 * WANTED_M, leader_mps=5.0, seconds=20.0)
    assert gap[-1] == pytest.approx(driver.STANDSTILL_GAP_M + 5.0 * 1.2, rel=0.05)


def test_what_was_seen_at_first_is_known_when_others_begin_anew(tmp_path: Path) -> None:
    world = crossroads(tmp_path)
    east = straight_on(world, EAST)
    behind = 94.5 + 0.6 * WANTED_M
    began = traffic(
        world, [east, east], before_m=[90.0, behind], speed_mps=[8.0, 8.0], lawful=[False, True]
    )
    before, after = began.begun(np.zeros(2, np.intp)), began.begun(np.zeros(2, np.intp))
    two = FAR_EGO._replace(
        poses=np.repeat(FAR_EGO.poses, 2, 0), speed_mps=np.zeros(2), arc_m=np.full(2, -500.0)
    )
    none = np.full((2, 0), np.inf)
    before.decide(two, none)
    after.carry_on(before, np.array([True, False]))
    # The leader is gone: who was seen behind it wants to be faster still, who was not does not.
    after.arc_m[:, 0] = -400.0
    after.step(time_s=np.zeros((2, 1)), dt_s=0.0)
    after.poses[:, 0] = np.nan
    after.decide(two, none)
    after.step(time_s=np.zeros((2, 1)), dt_s=1.0)
    assert after.speed_mps[0, 1] > 8.5
    assert after.speed_mps[1, 1] == pytest.approx(8.0, abs=0.05)


def test_who_turns_gets_past_one_that_stands_turned_beside_its_way(tmp_path: Path) -> None:
    """More than a metre to its left; along the heading of who turns, it would be in the way."""
    world = crossroads(tmp_path)
    turns = next(
        path_of(world, one)
        for one in world.connections
        if one.turn == "left" and one.centerline[0, 0] < -5.0 and one.centerline[-1, 1] > 5.0
    )
    yaw = math.radians(-159.0)
    beside = FrenetPath(
        np.array([-4.5, 2.6]) + np.outer([-99.0, 99.0], [math.cos(yaw), math.sin(yaw)])
    )
    before_m = [12.0, centre_arc(beside) - 99.0]
    moving = traffic(
        world, [turns, beside], before_m=before_m, speed_mps=[0.0, 0.0], lawful=[True, False]
    )
    seen = run(moving, seconds=12.0)[:, 0]
    assert seen[-1, 0] > centre_arc(turns) + 10.0
