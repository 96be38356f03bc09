"""Where a vehicle is reckoned to be, and that it is no farther from there than is said."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.contracts.drive import VehicleState
from foretwin.contracts.frames import GeoPoint, LocalFrame, local_pose
from foretwin.orchestrator.other_vehicles.dead_reckoning import (
    MOST_ASTRAY_M,
    astray_m,
    reckoned,
    reckoned_for_s,
)
from foretwin.sim_worker.vehicle.parameters import GRAVITY_MPS2, load_vehicle

CAR = load_vehicle(None)
HERE = GeoPoint(52.5, 13.4, 34.0)


def measured(speed_mps: float, accel_mps2: float, yaw_rate_radps: float) -> VehicleState:
    return VehicleState(
        vehicle_id="other", stamp_ns=5_000_000_000, position=HERE, yaw_rad=3.0,
        speed_mps=speed_mps, yaw_rate_radps=yaw_rate_radps, accel_mps2=accel_mps2,
    )  # fmt: skip


def test_a_car_in_a_bend_is_carried_on_around_it() -> None:
    # A quarter of a circle of 10 m in one second, and then some beyond the half turn.
    now = reckoned(measured(5.0 * math.pi, 0.0, math.pi / 2), 6_000_000_000)
    x_m, y_m, yaw_rad = local_pose(LocalFrame(HERE), now.position, now.yaw_rad)
    start = 3.0
    assert x_m == pytest.approx(10.0 * (math.sin(start + math.pi / 2) - math.sin(start)), abs=1e-6)
    assert y_m == pytest.approx(10.0 * (math.cos(start) - math.cos(start + math.pi / 2)), abs=1e-6)
    assert yaw_rad == pytest.approx(start + math.pi / 2 - 2 * math.pi, abs=1e-6)
    assert (now.stamp_ns, now.position.alt_m, now.speed_mps) == (
        6_000_000_000, 34.0, 5.0 * math.pi,
    )  # fmt: skip


def test_who_brakes_comes_to_rest_and_stays() -> None:
    now = reckoned(measured(2.0, -4.0, 0.1), 6_000_000_000)
    x_m, y_m, _ = local_pose(LocalFrame(HERE), now.position, now.yaw_rad)
    assert math.hypot(x_m, y_m) == pytest.approx(0.5, abs=1e-3)
    assert (now.speed_mps, now.yaw_rate_radps, now.accel_mps2) == (0.0, 0.0, 0.0)


def test_nobody_is_carried_back() -> None:
    state = measured(9.0, 0.0, 0.0)
    assert reckoned(state, state.stamp_ns - 1) is state


@given(
    st.floats(0.0, 30.0), st.floats(0.0, 2 * math.pi), st.floats(0.0, 1.0), st.floats(0.05, 0.44)
)
def test_a_driver_who_does_anything_that_tyres_hold_stays_within_the_bound(
    speed_mps: float, direction_rad: float, share: float, age_s: float
) -> None:
    # From steady driving straight ahead on, with any acceleration the tyres can give.
    grip_mps2 = share * CAR.friction.value * GRAVITY_MPS2
    push = grip_mps2 * np.array([math.cos(direction_rad), math.sin(direction_rad)])
    truth = np.array([speed_mps * age_s, 0.0]) + 0.5 * push * age_s**2
    where = np.array([speed_mps * age_s, 0.0])
    assert np.hypot(*(truth - where)) <= astray_m(CAR, age_s) + 1e-12
    assert astray_m(CAR, reckoned_for_s(CAR)) == pytest.approx(MOST_ASTRAY_M)


@pytest.mark.parametrize("name", ["bmw_320i", "city_bus", "vw_vanagon"])
def test_road_vehicles_are_reckoned_for_about_half_a_second(name: str) -> None:
    vehicle = load_vehicle(name)
    assert 0.4 < reckoned_for_s(vehicle) < 0.6, Path(name)
