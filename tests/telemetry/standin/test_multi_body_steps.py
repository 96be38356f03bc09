"""The stand-in moves as CommonRoad's own program says, and within its car's limits."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from vehiclemodels.init_mb import init_mb
from vehiclemodels.parameters_vehicle2 import parameters_vehicle2
from vehiclemodels.utils.acceleration_constraints import acceleration_constraints
from vehiclemodels.utils.steering_constraints import steering_constraints
from vehiclemodels.vehicle_dynamics_mb import vehicle_dynamics_mb

from foretwin.contracts.arrays import Array
from foretwin.geometry.multibody_equations import STATES
from foretwin.telemetry.standin.multi_body_steps import (
    car_numbers,
    change,
    runge_kutta,
    within_limits,
)
from tests.geometry.test_multibody_equations import SWAY

MODEL: Any = parameters_vehicle2()
NUMBERS = car_numbers(MODEL)


def theirs(state: Array, rate: float, accel: float) -> Array:
    """What the authors' program says; it writes into the state that it is given."""
    return np.array(vehicle_dynamics_mb(state.tolist(), [rate, accel], MODEL))


def moving(core: list[float]) -> Array:
    return np.array(init_mb([0.0, 0.0, *core], MODEL), dtype=float)


def test_limits_are_the_authors_to_the_last_bit() -> None:
    rng = np.random.default_rng(2)
    for _ in range(400):
        low, high = [-1.2, -0.6, -20.0, -14.0], [1.2, 0.6, 60.0, 14.0]
        angle, rate, speed, accel = rng.uniform(low, high).tolist()
        expected = (
            steering_constraints(angle, rate, MODEL.steering),
            acceleration_constraints(speed, accel, MODEL.longitudinal),
        )
        assert within_limits(angle, rate, speed, accel, NUMBERS.limits) == expected


def test_motion_is_the_authors_also_where_more_is_asked_than_the_car_can_do() -> None:
    rng = np.random.default_rng(1)
    for _ in range(200):
        core = rng.uniform([-1.0, 1.0, -3.0, -0.3, -0.05], [1.0, 55.0, 3.0, 0.3, 0.05]).tolist()
        state = moving(core) + SWAY * rng.normal(size=STATES)
        rate, accel = rng.uniform([-0.6, -13.0], [0.6, 13.0]).tolist()
        found = np.empty(STATES)
        expected = theirs(state, rate, accel)
        change(state, rate, accel, *NUMBERS, found)
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-8)


@pytest.mark.parametrize("steps", [1, 2])
def test_a_drive_through_bends_is_that_of_the_authors_equations(steps: int) -> None:
    compiled = moving([0.05, 12.0, 0.3, 0.1, 0.01])
    state, dt_s = compiled.copy(), 0.005 / steps
    for k in range(200):
        rate, accel = 0.3 * math.sin(0.05 * k) - 2.0 * state[2], 3.0 * math.sin(0.02 * k)
        runge_kutta(compiled, rate, accel, steps, dt_s, *NUMBERS)
        for _ in range(steps):
            k1 = theirs(state, rate, accel)
            k2 = theirs(state + 0.5 * dt_s * k1, rate, accel)
            k3 = theirs(state + 0.5 * dt_s * k2, rate, accel)
            k4 = theirs(state + dt_s * k3, rate, accel)
            state = state + dt_s / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    assert np.hypot(*(state[:2] - compiled[:2])) < 1e-7
    np.testing.assert_allclose(compiled, state, rtol=1e-7, atol=1e-7)
