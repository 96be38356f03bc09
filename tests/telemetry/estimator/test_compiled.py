"""The filter's compiled arithmetic against the same in matrices, as books have it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.contracts.arrays import Array
from foretwin.telemetry.estimator.compiled import correct, predict
from foretwin.telemetry.estimator.filter_state import (
    ACCEL,
    CURVATURE,
    GNSS_X,
    GNSS_Y,
    SIZE,
    SLIP,
    SPEED,
    YAW,
    X,
    Y,
)
from foretwin.telemetry.estimator.motion_noise import GNSS_CORRELATION_S

COVERS = ("foretwin.telemetry.estimator.filter_state",)

SILENT = (0.0,) * 6
DENSITIES = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6)


def spread(seed: int, size: int = SIZE) -> Array:
    drawn = np.random.default_rng(seed).normal(size=(size, size))
    return np.ascontiguousarray(drawn @ drawn.T)


def moving(*, speed: float = 8.0, accel: float = 1.0, size: int = SIZE) -> Array:
    mean = np.zeros(size)
    mean[[X, Y, YAW, SPEED, ACCEL, CURVATURE]] = 3.0, -2.0, 0.7, speed, accel, 0.04
    mean[[GNSS_X, GNSS_Y, SLIP]] = 1.0, -2.0, 0.004
    return mean


def moved(mean: Array, dt: float) -> Array:
    after = mean.copy()
    predict(after, np.zeros((len(mean), len(mean))), dt, False, SILENT, 0.0)
    return after


def derivative(mean: Array, dt: float) -> Array:
    columns = []
    for index in range(len(mean)):
        step = 1e-6 * np.eye(len(mean))[index]
        columns.append((moved(mean + step, dt) - moved(mean - step, dt)) / 2e-6)
    return np.stack(columns, axis=1)


@given(st.integers(0, 1000), st.floats(0.001, 0.05), st.sampled_from([SIZE, SIZE + 1]))
def test_the_covariance_goes_on_by_the_derivative_of_the_step(
    seed: int, dt: float, size: int
) -> None:
    mean, covariance = moving(size=size), spread(seed, size)
    jacobian = derivative(mean, dt)
    expected = jacobian @ covariance @ jacobian.T
    predict(mean, covariance, dt, False, SILENT, 0.0)
    assert np.allclose(covariance, expected, rtol=1e-6, atol=1e-6)


def test_each_component_wanders_by_its_own_density_and_the_receiver_by_its_error() -> None:
    quiet, noisy, dt, std_m = spread(1), spread(1), 0.02, 3.0
    predict(moving(), quiet, dt, False, SILENT, 0.0)
    predict(moving(), noisy, dt, False, DENSITIES, std_m)
    added = noisy - quiet
    wandered = std_m**2 * (1.0 - math.exp(-2.0 * dt / GNSS_CORRELATION_S))
    expected = [0.0, 0.0, *(dt * one for one in DENSITIES), wandered, wandered, 0.0, 0.0]
    assert np.diag(added) == pytest.approx(expected, abs=1e-12)
    assert np.allclose(added - np.diag(np.diag(added)), 0.0, atol=1e-12)


def test_a_car_drives_along_its_arc() -> None:
    mean, dt = moving(), 0.05
    mean[SLIP] = 0.0
    after = moved(mean, dt)
    way = 8.0 * dt + 0.5 * dt * dt
    assert after[SPEED] == pytest.approx(8.05)
    assert after[YAW] == pytest.approx(0.7 + 0.04 * way)
    assert np.hypot(after[X] - 3.0, after[Y] + 2.0) == pytest.approx(way, rel=1e-9)
    assert math.atan2(after[Y] + 2.0, after[X] - 3.0) == pytest.approx(0.7 + 0.02 * way)
    assert after[GNSS_X] == pytest.approx(math.exp(-dt / GNSS_CORRELATION_S))


def test_a_braking_car_stops_within_the_step_unless_it_may_reverse() -> None:
    stopped, backing = moving(speed=0.1, accel=-4.0), moving(speed=0.1, accel=-4.0)
    predict(stopped, spread(2), 0.05, False, SILENT, 0.0)
    predict(backing, spread(2), 0.05, True, SILENT, 0.0)
    assert stopped[SPEED] == pytest.approx(0.0, abs=1e-15)
    assert stopped[ACCEL] == pytest.approx(-2.0)
    assert backing[SPEED] == pytest.approx(-0.1)


@given(st.integers(0, 1000))
def test_a_measurement_is_applied_as_kalman_has_it(seed: int) -> None:
    mean, covariance = moving(), spread(seed)
    row = np.random.default_rng(seed + 1).normal(size=SIZE)
    variance = row @ covariance @ row + 0.3**2
    gain = covariance @ row / variance
    expected_mean = mean + gain * 1.7
    expected = covariance - np.outer(gain, gain) * variance
    assert correct(mean, covariance, row, 1.7, 0.3) == pytest.approx(variance)
    assert np.allclose(mean, expected_mean)
    assert np.allclose(covariance, expected, atol=1e-9)
