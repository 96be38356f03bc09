"""The filter's arithmetic compiled: a numpy call costs ten times what it does with 12 numbers."""

from __future__ import annotations

import math

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.geometry.compiled import OUT, OUT_ROWS, REAL, WHOLE, given, kernel, types
from foretwin.telemetry.estimator.filter_state import (
    ACCEL,
    CURVATURE,
    GNSS_X,
    GNSS_Y,
    SLIP,
    SPEED,
    YAW,
    X,
    Y,
)
from foretwin.telemetry.estimator.motion_noise import GNSS_CORRELATION_S

LINE = given(1, "C")


@kernel(types.void, OUT, OUT_ROWS, REAL, WHOLE, types.UniTuple(REAL, 6), REAL)
def predict(
    mean: Array,
    covariance: Array,
    dt: float,
    may_reverse: int,
    densities: tuple[float, ...],
    gnss_std_m: float,
) -> None:
    """Move `mean` (N,) and `covariance` (N, N) on by one step of constant acceleration and
    curvature.

    The covariance becomes J P J' + Q: J, the step's derivative, differs from one in the first four
    rows alone and in how the receiver's error fades; Q is of `densities` as motion_noise has them,
    and of that error.
    """
    size = len(mean)
    yaw, speed, accel = mean[YAW], mean[SPEED], mean[ACCEL]
    curvature, slip = mean[CURVATURE], mean[SLIP]
    if not may_reverse and speed + accel * dt < 0.0:
        accel = min(0.0, -speed / dt)  # it stops within the step
    distance = (speed + 0.5 * accel * dt) * dt
    # The rear axle moves outwards of where the body points, the more the harder it turns.
    heading = yaw + 0.5 * curvature * distance - slip * speed * speed * curvature
    cos, sin = math.cos(heading), math.sin(heading)
    half = 0.5 * dt * dt
    side = distance * (0.5 * curvature * dt - 2.0 * slip * speed * curvature)
    by_accel = 0.5 * distance * curvature * half
    by_curvature = distance * (0.5 * distance - slip * speed * speed)
    by_slip = -distance * speed * speed * curvature
    fading = math.exp(-dt / GNSS_CORRELATION_S)
    x_by = (
        -distance * sin,
        dt * cos - side * sin,
        half * cos - by_accel * sin,
        -by_curvature * sin,
        -by_slip * sin,
    )
    y_by = (
        distance * cos,
        dt * sin + side * cos,
        half * sin + by_accel * cos,
        by_curvature * cos,
        by_slip * cos,
    )
    # J P, and then (J P) J' in the same way: column by column what was done row by row.
    for turn in range(2):
        of = covariance if turn == 0 else covariance.T
        for k in range(size):
            yaw_k, speed_k, accel_k = of[YAW, k], of[SPEED, k], of[ACCEL, k]
            curvature_k, slip_k = of[CURVATURE, k], of[SLIP, k]
            of[X, k] += (
                x_by[0] * yaw_k
                + x_by[1] * speed_k
                + x_by[2] * accel_k
                + x_by[3] * curvature_k
                + x_by[4] * slip_k
            )
            of[Y, k] += (
                y_by[0] * yaw_k
                + y_by[1] * speed_k
                + y_by[2] * accel_k
                + y_by[3] * curvature_k
                + y_by[4] * slip_k
            )
            of[YAW, k] += (
                curvature * dt * speed_k + curvature * half * accel_k + distance * curvature_k
            )
            of[SPEED, k] += dt * accel_k
            of[GNSS_X, k] *= fading
            of[GNSS_Y, k] *= fading
    for k in range(6):
        covariance[YAW + k, YAW + k] += dt * densities[k]
    wandered = gnss_std_m * gnss_std_m * (1.0 - fading * fading)
    covariance[GNSS_X, GNSS_X] += wandered
    covariance[GNSS_Y, GNSS_Y] += wandered
    mean[X] += distance * cos
    mean[Y] += distance * sin
    mean[YAW] = yaw + curvature * distance
    mean[SPEED], mean[ACCEL] = speed + accel * dt, accel
    mean[GNSS_X] *= fading
    mean[GNSS_Y] *= fading


@kernel(REAL, OUT, OUT_ROWS, LINE, REAL, REAL)
def correct(mean: Array, covariance: Array, row: Array, residual: float, std: float) -> float:
    """Apply one scalar measurement to `mean` (N,) and `covariance` (N, N); return its variance.

    `row` (N,) is its derivative by the state.
    """
    size = len(mean)
    cross = np.empty(size)
    variance = 0.0
    for i in range(size):
        total = 0.0
        for k in range(size):
            total += covariance[i, k] * row[k]
        cross[i] = total
        variance += row[i] * total
    variance += std * std
    for i in range(size):
        mean[i] += cross[i] * (residual / variance)
        for k in range(size):
            covariance[i, k] -= cross[i] * (cross[k] / variance)
    return variance


@kernel(types.boolean, OUT_ROWS)
def spreads_are_any(covariance: Array) -> bool:
    """Return whether all variances of a covariance (N, N) are some; NaN is none."""
    return bool(np.all(np.diag(covariance) >= 0.0))
