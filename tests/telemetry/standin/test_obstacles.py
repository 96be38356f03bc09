"""Who is in the way of the stand-in: on its path, or about to be, a car's width wide."""

from __future__ import annotations

import math
from typing import Any

import pytest
from msgspec.structs import replace

from foretwin.contracts.drive import RoadUser
from foretwin.contracts.frames import geo_pose
from foretwin.telemetry.standin.obstacles import FRONT_M, hindrance
from tests.telemetry.lot_car.test_braking import ANCHOR, straight


def somebody(along_m: float, left_m: float, yaw_rad: float = 0.0, **changed: Any) -> RoadUser:
    cos, sin = math.cos(ANCHOR.lot.yaw_rad), math.sin(ANCHOR.lot.yaw_rad)
    x_m, y_m = along_m * cos - left_m * sin, along_m * sin + left_m * cos
    at = geo_pose(ANCHOR.lot.frame, x_m, y_m, ANCHOR.lot.yaw_rad + yaw_rad)
    user = RoadUser(
        user_id="a", kind="pedestrian", position=at.position, yaw_rad=at.yaw_rad, speed_mps=0.0,
        length_m=0.5, width_m=0.6,
    )  # fmt: skip
    return replace(user, **changed)


PATH = straight(100.0)


def test_who_stands_in_its_way_is_met_two_metres_before():
    found = hindrance(PATH, 5.0, [somebody(30.0, 0.0), somebody(50.0, 0.0)])
    assert found is not None
    assert found.s_m == pytest.approx(30.0 - 0.25 - FRONT_M - 2.0, abs=0.05)
    assert found.gap_m(10.0) == pytest.approx(30.0 - 0.25 - FRONT_M - 10.0, abs=0.05)
    assert found.speed_mps == 0.0


@pytest.mark.parametrize("left_m", [1.6, -1.6])
def test_who_stands_beside_its_way_does_not_hinder(left_m: float):
    assert hindrance(PATH, 5.0, [somebody(30.0, left_m)]) is None
    assert hindrance(PATH, 5.0, [somebody(30.0, left_m * 1.45 / 1.6)]) is not None


def test_whom_it_has_passed_does_not_hinder():
    assert hindrance(PATH, 5.0, [somebody(5.0 + FRONT_M - 0.5, 0.0)]) is None
    assert hindrance(PATH, 5.0, [somebody(2.0, 0.0)]) is None
    assert hindrance(PATH, 5.0, []) is None


def test_who_walks_into_its_way_hinders_before_being_there():
    walks = somebody(30.0, -5.0, math.pi / 2, speed_mps=1.4)
    assert hindrance(PATH, 5.0, [walks]) is not None
    assert hindrance(PATH, 5.0, [replace(walks, speed_mps=0.5)]) is None
    # Seen three seconds ago, the slow one is nearer by now.
    assert hindrance(PATH, 5.0, [replace(walks, speed_mps=0.7)], age_s=3.0) is not None
    away = somebody(30.0, -2.0, -math.pi / 2, speed_mps=1.4)
    assert hindrance(PATH, 5.0, [away]) is None


def test_behind_a_car_that_drives_it_need_not_stand():
    leads = somebody(30.0, 0.0, kind="car", speed_mps=6.0, length_m=4.5, width_m=1.8)
    found = hindrance(PATH, 5.0, [leads])
    assert found is not None
    assert found.speed_mps == pytest.approx(6.0, abs=0.01)
    oncoming = hindrance(PATH, 5.0, [somebody(60.0, 0.0, math.pi, speed_mps=5.0)])
    assert oncoming is not None
    assert oncoming.speed_mps == 0.0
