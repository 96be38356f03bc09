"""Which signals of a stretch of driving agree with which: gains, offsets, delays, plateaus."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from contracts.arrays import Array
from sim_worker.gap.fitting import Follower, Line, follower, line_through
from sim_worker.gap.pairs import Pairs
from sim_worker.motion_record import PERIOD_S

_MIN_TURN_RAD, _MIN_CURVATURE_PM = 0.012, 0.006
_HARD_MPS2 = 1.2
_EVERY = 5
"""Smoothed signals need not be compared at every sample."""


class Consistency(NamedTuple):
    """What a stretch says of each pair; None where it says nothing.

    Steering lines are in tyre angles as the model reads them, turns in curvature: offsets of
    `motion_by_measured` are 1/m.
    """

    gyro_by_course: Line | None
    speed_by_gnss: Line | None
    measured_by_command: Follower | None
    model_by_command: Follower | None
    motion_by_measured: Line | None
    motion_by_measured_hard: Line | None
    """The same where the lateral acceleration is high."""
    missing_mps2: float
    """Lateral acceleration (RMS) by which the model at the measured steering misses the car's."""
    motion_lag_s: float
    """By how much the model's turning lags behind the car's, NaN where unknown."""
    motion_by_command: Line | None
    motion_by_angle: Line | None
    """Kinematic tyre angle of the motion over the measured one: free of the model's limits."""
    excited_s: float
    moved_s: float


def consistency_of(pairs: Pairs) -> Consistency:
    """Compare the signals of one stretch (some seconds) pair by pair."""
    measured = model = angle = None
    if _varies(pairs.asked_rad) or _varies(pairs.done_rad):
        measured = follower(pairs.asked_rad, pairs.done_rad)
    if _varies(pairs.commanded_rad):
        model = follower(pairs.commanded_rad, pairs.model_tire_rad)
    if _varies(pairs.done_rad):
        angle = _line(pairs.done_rad, pairs.arc_rad)
    real, by_measured = pairs.curvature_pm, pairs.by_measured_pm
    hard = np.abs(real * pairs.speed_mps**2) > _HARD_MPS2
    motion = _turning(by_measured, real)
    return Consistency(
        gyro_by_course=_turn_rates(pairs),
        speed_by_gnss=_mean_ratio(pairs.ground_mps[::_EVERY], pairs.wheel_mps[::_EVERY],
                                  period_s=_EVERY * PERIOD_S, together_s=0.4, least_s=1.5),
        measured_by_command=measured,
        model_by_command=model,
        motion_by_measured=motion,
        motion_by_measured_hard=None if motion is None else _mean_ratio(
            np.where(hard, by_measured, np.nan), real,
            period_s=PERIOD_S, together_s=0.4, least_s=0.6),
        missing_mps2=_missing(pairs),
        motion_lag_s=_lag(by_measured, real),
        motion_by_command=_turning(pairs.by_command_pm, real),
        motion_by_angle=angle,
        excited_s=float(pairs.excited.sum()) * PERIOD_S,
        moved_s=float(pairs.moves.sum()) * PERIOD_S,
    )  # fmt: skip


def _varies(angle: Array) -> bool:
    known = angle[np.isfinite(angle)]
    return len(known) > 50 and bool(np.ptp(known) > _MIN_TURN_RAD)


def _line(x: Array, y: Array, *, together_s: float = 0.3) -> Line | None:
    known = np.isfinite(x) & np.isfinite(y)
    return line_through(x[known], y[known], independent=known.sum() * PERIOD_S / together_s)


def _turning(model: Array, real: Array) -> Line | None:
    """Fit the car's curvature over the model's, None where neither varies."""
    known = np.isfinite(model) & np.isfinite(real)
    if not known.any():
        return None
    widest = max(float(np.ptp(model[known])), float(np.ptp(real[known])))
    return _line(model, real) if widest > _MIN_CURVATURE_PM else None


def _turn_rates(pairs: Pairs) -> Line | None:
    """Fit how the gyro goes with the course's rate; without a bend its bias alone."""
    course, gyro = pairs.course_radps[::_EVERY], pairs.gyro_radps[::_EVERY]
    known = np.isfinite(course) & np.isfinite(gyro)
    course, gyro = course[known], gyro[known]
    seconds = len(course) * _EVERY * PERIOD_S
    if seconds < 1.2:
        return None
    independent = max(seconds / 0.4, 2.0)
    # The course is by far the noisier: over it the gyro's gain would come out too small.
    line = line_through(gyro, course, independent=independent)
    if line is not None and line.gain > 5.0 * line.gain_std:
        gain = 1.0 / line.gain
        gain_std, offset_std = line.gain_std * gain**2, line.offset_std * gain
        offset = -line.offset * gain
        return line._replace(gain=gain, gain_std=gain_std, offset=offset, offset_std=offset_std)
    # The slower the car, the less its positions say of its course.
    weight = pairs.ground_mps[::_EVERY][known] ** 2
    weight /= np.sum(weight)
    apart = gyro - course
    offset = float(np.sum(weight * apart))
    std = float(np.sqrt(np.sum(weight * (apart - offset) ** 2)))
    heard = independent / (len(weight) * float(np.sum(weight**2)))
    return Line(1.0, np.inf, offset, std / np.sqrt(heard), std, 0.0)


def _missing(pairs: Pairs) -> float:
    """Return the RMS of the lateral acceleration between model and car in bends, NaN in none."""
    apart = (pairs.curvature_pm - pairs.by_measured_pm) * pairs.speed_mps**2
    apart = apart[pairs.excited & np.isfinite(apart)]
    if len(apart) * PERIOD_S < 0.6:
        return float("nan")
    return float(np.sqrt(np.mean(apart * apart)))


def _mean_ratio(
    x: Array, y: Array, *, period_s: float, together_s: float, least_s: float
) -> Line | None:
    """Fit y = gain x: some signals vary too little in seconds to part an offset from a gain."""
    known = np.isfinite(x) & np.isfinite(y)
    x, y = x[known], y[known]
    if len(x) * period_s <= least_s:
        return None
    gain = float(np.sum(x * y) / np.sum(x * x))
    left = y - gain * x
    independent = max(len(x) * period_s / together_s, 2.0)
    residual = float(np.sqrt(np.sum(left * left) / (len(x) - 1)))
    std = residual / float(np.sqrt(np.mean(x * x) * independent))
    return Line(gain, std, 0.0, 0.0, residual, 1.0)


def _lag(model: Array, real: Array) -> float:
    """Return how much the model's turning lags behind the car's, by the best common shift."""
    known = np.flatnonzero(np.isfinite(model))
    if len(known) < 10 or float(np.ptp(model[known])) < 0.02:
        return float("nan")
    shifts = range(-10, 21)
    errors = []
    for shift in shifts:
        at = known - shift
        inside = (at >= 0) & (at < len(real))
        inside[inside] &= np.isfinite(real[at[inside]])
        if inside.sum() < 0.8 * len(known):
            errors.append(np.inf)
            continue
        other, flat = real[at[inside]], model[known[inside]]
        scale = float(np.sum(flat * other) / max(np.sum(flat * flat), 1e-12))
        errors.append(float(np.mean((other - scale * flat) ** 2)))
    best = int(np.argmin(errors))
    unshifted = errors[10]
    if not np.isfinite(unshifted) or errors[best] > 0.5 * unshifted:
        return 0.0
    return shifts[best] * PERIOD_S
