"""How an actuator follows its command: dead time and lag, from the command and its measurement.

The steering wheel follows its command u as dw/dt = (g u(t - d) + c - w) / τ. For a given dead time
d that is linear in the rest; d is searched by Gauss-Newton from the best of a grid. Stretches
near the greatest rate of the actuator are left out: there the rate says nothing of the lag.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array, Flags
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.sim_worker.analysis.identify.regression import (
    Fit,
    delayed,
    fit_linear,
    smoothed,
    smoothed_and_rate,
)
from foretwin.sim_worker.analysis.motion_record import MotionRecord

WIDTH_S = 0.05
MAX_DELAY_S = 0.6
_GRID_S = 0.02
_RATE_SHARE = 0.8
_SLOWEST_MPS = 0.5


class FollowingFit(NamedTuple):
    """How steering follows: estimates with half their 95 % intervals."""

    delay_s: float
    delay_half_s: float
    lag_s: float
    lag_half_s: float
    moving_s: float
    """Seconds in which the command moved."""


def best_delay(columns_at: Callable[[float], Array], target: Array) -> float:
    """Return the delay with which columns (N, K) explain `target` (N,) best.

    That is the least of errors on a grid of 0.02 s, between its points.
    """
    errors = []
    for delay_s in delays():
        columns = columns_at(float(delay_s))
        gram = columns.T @ columns + 1e-9 * np.eye(columns.shape[1])
        left = target - columns @ np.linalg.solve(gram, columns.T @ target)
        errors.append(float(np.mean(np.square(left))))
    index = int(np.argmin(errors))
    if not 0 < index < len(errors) - 1:
        return index * _GRID_S
    before, here, after = errors[index - 1 : index + 2]
    bend = before - 2.0 * here + after
    return (index + (0.5 * (before - after) / bend if bend > 0.0 else 0.0)) * _GRID_S


def delays() -> Array:
    """Return the grid on which dead times are searched first."""
    return np.asarray(np.arange(round(MAX_DELAY_S / _GRID_S) + 1) * _GRID_S, dtype=np.float64)


def known_back(values: Array, *, period_s: float) -> Flags:
    """Return where (N,) is known, and has been for all the dead times that are searched."""
    back = round(MAX_DELAY_S / period_s) + 1
    unknown = np.concatenate([np.ones(back, dtype=bool), ~np.isfinite(values)])
    counted = np.concatenate([[0], np.cumsum(unknown)])
    return np.asarray(counted[back + 1 :] == counted[: -back - 1])


def _blur_s(values: Array, *, period_s: float) -> float:
    """Return by how much lines drawn between samples blur a signal, as a standard deviation.

    The mean over all instants is a triangle as wide as two samples are apart, and how far they are
    apart shows in (N,) itself: between them, the slope does not change.
    """
    bends = np.abs(np.diff(values, 2))
    bends = bends[np.isfinite(bends)]
    if not bends.any():
        return 0.0
    share = float(np.mean(bends > 1e-9 * np.max(bends)))
    apart_s = period_s / share
    return apart_s / math.sqrt(6.0) if apart_s > 1.5 * period_s else 0.0


def fit_following(record: MotionRecord, vehicle: VehicleParameters) -> FollowingFit:
    """Fit how the measured steering follows its command; ValueError saying what it lacks.

    Steering wheel against steering wheel, or tyre against tyre, whichever the record has.
    """
    at_wheel = record.has("wheel_rad") and record.has("command_wheel_rad")
    if not at_wheel and not (record.has("tire_rad") and record.has("command_tire_rad")):
        raise ValueError("steering is not both commanded and measured")
    measured = record.wheel_rad if at_wheel else record.tire_rad
    command = record.command_wheel_rad if at_wheel else record.command_tire_rad
    fastest = vehicle.max_tire_rate_radps.value
    fastest *= abs(vehicle.steering_ratio.value) if at_wheel else 1.0
    period_s = float(record.time_s[1])
    angle, rate = smoothed_and_rate(measured, period_s=period_s, width_s=WIDTH_S)
    # A held command lies half its period later than its stamps say once it is smoothed.
    blur_s = _blur_s(measured, period_s=period_s)
    asked = smoothed(command, period_s=period_s, width_s=math.hypot(WIDTH_S, blur_s))
    asked = delayed(asked, period_s=period_s, delay_s=0.5 * period_s)
    asking = np.gradient(asked, period_s)
    driving = np.nan_to_num(np.abs(record.speed_mps), nan=1.0) > _SLOWEST_MPS
    free = np.isfinite(angle) & np.isfinite(rate) & driving & ~record.manual
    free &= np.abs(rate) < _RATE_SHARE * fastest
    free[: round((MAX_DELAY_S + 0.2) / period_s)] = False
    free &= known_back(asking, period_s=period_s)
    used = np.flatnonzero(free)
    moving_s = float(np.sum(np.abs(asking[used]) > 0.1 * fastest / 4.0) * period_s)
    if len(used) < 100:
        raise ValueError("the car did not steer by command")
    w, dw = angle[used], rate[used]

    def plain(delay_s: float) -> Array:
        due = delayed(asked, period_s=period_s, delay_s=delay_s)[used]
        return np.stack([due, np.ones_like(w), -w], axis=1)

    delay_s = best_delay(plain, dw)
    fit: Fit | None = None
    for _ in range(4):
        changing = delayed(asking, period_s=period_s, delay_s=delay_s)[used]
        columns = plain(delay_s)
        start = np.linalg.lstsq(columns, dw, rcond=None)[0] if fit is None else fit.values[:3]
        columns = np.column_stack([columns, -start[0] * changing])
        fit = fit_linear(columns, dw, record.time_s[used])
        delay_s = float(np.clip(delay_s + fit.values[3], 0.0, MAX_DELAY_S))
    assert fit is not None
    lag_s = 1.0 / float(fit.values[2])
    # A blur of s looks like s²/2τ more lag and less delay. It is s on the average alone: how the
    # samples fall upon the steps of the command repeats, and may make nothing of it or double it.
    step_half_s = fit.quantile * blur_s**2 / (2.0 * lag_s)
    return FollowingFit(
        delay_s=delay_s,
        delay_half_s=math.hypot(fit.half_width(3), step_half_s[3]),
        lag_s=lag_s,
        lag_half_s=math.hypot(fit.half_width(2) * lag_s**2, step_half_s[2]),
        moving_s=moving_s,
    )
