"""What the law-abiding choose: within what a vehicle can, in bends and before lights."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from foretwin.contracts.arrays import Array
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.sim_worker import driver_model as driver
from tests.sim_worker.road_users.crossroads import centre_arc, crossroads, run, straight_on, traffic
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


def test_nobody_brakes_harder_than_tyres_do_however_late_it_sees_who_stands(tmp_path: Path) -> None:
    world = crossroads(tmp_path)
    east = straight_on(world, EAST)
    moving = traffic(
        world, [east, east], before_m=[40.0, 50.0], speed_mps=[0.0, 16.0], lawful=[False, True]
    )
    seen = run(moving, seconds=4.0)[:, 1]
    hardest = np.diff(seen[:, 1]).min() / 0.05
    assert hardest == pytest.approx(-driver.EMERGENCY_DECEL_MPS2, abs=1e-6)
