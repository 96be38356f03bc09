"""Which signals of a stretch of driving agree with which: gains, offsets, delays, plateaus.

And when a departure began, within the stretch that shows it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.geometry.shifted_fit import TOGETHER_S
from foretwin.sim_worker.analysis.gap.fitting import (
    DelayedLine,
    Line,
    delayed_line,
    late_line,
    line_through,
)
from foretwin.sim_worker.analysis.gap.free_run import MIN_TURN_RAD
from foretwin.sim_worker.analysis.gap.pairs import SignalPairs
from foretwin.sim_worker.analysis.motion_record import PERIOD_S

_MIN_CURVATURE_PM = 0.006
_HARD_MPS2 = 1.2
_LEAST_SWING_PM, _LONGEST_LAG_S = 0.02, 0.4
_GAIN_OF_A_LAG = 0.4
"""Who turns late and by another share than this off does not only turn late. Chosen."""
_LEAST_STOP_S = 0.3
_SPEEDS_TOGETHER_S = 0.4
"""For so long, speeds and courses from positions err alike."""
_CLOCKS_APART_S = 0.16
"""Of steering and gyro: more would cost the ends of a stretch, and a verdict time. Chosen."""
_POSITIONS_LATE_S = 0.1
"""How late positions may be stamped (standard deviation): receivers take up to 0.2 s."""
_LEAST_TURN_RADPS = 0.03
"""Positions that are good to 2 cm tell the rate of a course to 0.006 rad/s: how a car weaves on a
straight is less, and says nothing of its gyro's gain."""
_EVERY = 5
"""Smoothed signals need not be compared at every sample."""


class Lag(NamedTuple):
    """A time and its standard deviation."""

    seconds: float
    std_s: float


class Consistency(NamedTuple):
    """What a stretch says of each pair; None where it says nothing.

    Steering lines are in tyre angles as the model reads them, turns in curvature: offsets of
    `motion_by_measured` are 1/m.
    """

    gyro_by_course: Line | None
    speed_by_gnss: Line | None
    measured_by_command: DelayedLine | None
    model_by_command: DelayedLine | None
    model_stops_at_rad: float
    """The tyre angle that the model holds while commands and car go beyond, NaN where none."""
    motion_by_measured: Line | None
    motion_by_measured_hard: Line | None
    """The same where the lateral acceleration is high."""
    missing_mps2: float
    """Lateral acceleration (RMS) by which the model at the measured steering misses the car's."""
    motion_lag: Lag | None
    """By how much the model's turning lags behind the car's."""
    motion_by_command: Line | None
    motion_by_angle: Line | None
    """Kinematic tyre angle of the motion over the measured one: free of the model's limits."""
    excited_s: float
    moved_s: float


def consistency_of(pairs: SignalPairs) -> Consistency:
    """Compare the signals of one stretch (some seconds) pair by pair."""
    pairs = _followable(pairs)
    measured = model = angle = None
    if _varies(pairs.asked_rad) or _varies(pairs.done_rad):
        measured = delayed_line(pairs.asked_rad, pairs.done_rad)
    if _varies(pairs.commanded_rad):
        model = delayed_line(pairs.commanded_rad, pairs.model_tire_rad)
    if _varies(pairs.done_rad):
        angle = _line(pairs.done_rad, pairs.arc_rad)
    real, by_measured = pairs.curvature_pm, pairs.by_measured_pm
    hard = np.abs(real * pairs.speed_mps**2) > _HARD_MPS2
    motion, motion_hard = _turning(by_measured, real), None
    if motion is not None:
        hard_bends = np.where(hard, by_measured, np.nan)
        motion_hard = _mean_ratio(hard_bends, real, period_s=PERIOD_S, least_s=0.6)
    return Consistency(
        gyro_by_course=gyro_by_course(pairs.course_radps, pairs.gyro_radps, pairs.ground_mps),
        speed_by_gnss=speed_by_gnss(pairs.ground_mps, pairs.wheel_mps),
        measured_by_command=measured,
        model_by_command=model,
        model_stops_at_rad=_stop(pairs.commanded_rad, pairs.done_rad, pairs.model_tire_rad),
        motion_by_measured=motion,
        motion_by_measured_hard=motion_hard,
        missing_mps2=_missing(pairs),
        motion_lag=_lag(by_measured, real),
        motion_by_command=_turning(pairs.by_command_pm, real),
        motion_by_angle=angle,
        excited_s=float(pairs.excited.sum()) * PERIOD_S,
        moved_s=float(pairs.moves.sum()) * PERIOD_S,
    )


def _followable(pairs: SignalPairs) -> SignalPairs:
    """Leave out commands that outrun every car: behind them it has no gain, offset or delay."""
    asked, commanded = (
        np.where(pairs.too_fast, np.nan, angle) for angle in (pairs.asked_rad, pairs.commanded_rad)
    )
    return pairs._replace(asked_rad=asked, commanded_rad=commanded)


def _varies(angle: Array) -> bool:
    known = angle[np.isfinite(angle)]
    return len(known) > 50 and bool(np.ptp(known) > MIN_TURN_RAD)


def _stop(asked: Array, done: Array, model: Array) -> float:
    """Return where the tyres of the model, which has no noise, stop."""
    known = np.isfinite(asked) & np.isfinite(done) & np.isfinite(model)
    asked, done, model = np.abs(asked[known]), np.abs(done[known]), np.abs(model[known])
    top = float(np.max(model, initial=0.0))
    held = (model > 0.995 * top) & (np.minimum(asked, done) > 1.1 * top)
    return top if held.sum() * PERIOD_S >= _LEAST_STOP_S else float("nan")


def _line(x: Array, y: Array) -> Line | None:
    known = np.isfinite(x) & np.isfinite(y)
    return line_through(x[known], y[known], independent=known.sum() * PERIOD_S / TOGETHER_S)


def _turning(model: Array, real: Array) -> Line | None:
    """Fit the car's curvature over the model's, None where neither varies."""
    known = np.isfinite(model) & np.isfinite(real)
    if not known.any():
        return None
    widest = max(float(np.ptp(model[known])), float(np.ptp(real[known])))
    return _line(model, real) if widest > _MIN_CURVATURE_PM else None


def speed_by_gnss(ground_mps: Array, wheel_mps: Array) -> Line | None:
    """Fit how the measured speed (N,) goes with that over ground; None for less than 1.5 s."""
    ground, wheels = ground_mps[::_EVERY], wheel_mps[::_EVERY]
    return _mean_ratio(ground, wheels, period_s=_EVERY * PERIOD_S, least_s=1.5)


def gyro_by_course(course_radps: Array, gyro_radps: Array, ground_mps: Array) -> Line | None:
    """Fit how the gyro (N,) goes with the course's rate; without a bend its bias alone.

    Positions may be stamped late: on the way into a bend that looks like a bias.
    """
    signals = (course_radps, gyro_radps, np.gradient(gyro_radps) / PERIOD_S, ground_mps)
    columns = np.stack([one[::_EVERY] for one in signals])
    course, gyro, changes, ground_mps = columns[:, np.isfinite(columns).all(axis=0)]
    seconds = len(course) * _EVERY * PERIOD_S
    if seconds < 1.2:
        return None
    independent = max(seconds / _SPEEDS_TOGETHER_S, 2.0)
    # The course is by far the noisier: over it the gyro's gain would come out too small.
    bends = float(np.ptp(gyro)) > _LEAST_TURN_RADPS
    line = None
    if bends:
        line = late_line(
            gyro, course, changes, independent=independent, late_std_s=_POSITIONS_LATE_S
        )
    if line is not None and abs(line.gain) > 5.0 * line.gain_std:
        gain = 1.0 / line.gain
        gain_std, offset_std = line.gain_std * gain**2, line.offset_std * abs(gain)
        offset = -line.offset * gain
        return line._replace(gain=gain, gain_std=gain_std, offset=offset, offset_std=offset_std)
    # The slower the car, the less its positions say of its course.
    weight = ground_mps**2 / np.sum(ground_mps**2)
    heard = independent / (len(weight) * float(np.sum(weight**2)))
    apart = gyro - course
    offset = float(np.sum(weight * apart))
    std = float(np.sqrt(np.sum(weight * (apart - offset) ** 2)))
    return Line(1.0, np.inf, offset, std / float(np.sqrt(heard)), std, 0.0)


def _missing(pairs: SignalPairs) -> float:
    """Return the RMS of the lateral acceleration between model and car in bends, NaN in none.

    Clocks may be `_CLOCKS_APART_S` apart: it is that with which they agree best.
    """
    real, model = (
        np.where(pairs.excited, one, np.nan) * pairs.speed_mps**2
        for one in (pairs.curvature_pm, pairs.by_measured_pm)
    )
    most, count = round(_CLOCKS_APART_S / PERIOD_S), len(real)
    if count <= 2 * most:
        return float("nan")
    inner = slice(most, count - most)
    late = np.lib.stride_tricks.sliding_window_view(model, count - 2 * most)[::2]
    apart = late - real[inner]
    known = np.isfinite(apart).all(axis=0)
    if known.sum() * PERIOD_S < 0.6:
        return float("nan")
    return float(np.sqrt(np.min(np.mean(apart[:, known] ** 2, axis=1))))


def _mean_ratio(x: Array, y: Array, *, period_s: float, least_s: float) -> Line | None:
    """Fit y = gain x: some signals vary too little in seconds to part an offset from a gain."""
    known = np.isfinite(x) & np.isfinite(y)
    x, y = x[known], y[known]
    if len(x) * period_s <= least_s:
        return None
    gain = float(np.sum(x * y) / np.sum(x * x))
    left = y - gain * x
    independent = max(len(x) * period_s / _SPEEDS_TOGETHER_S, 2.0)
    residual = float(np.sqrt(np.sum(left * left) / (len(x) - 1)))
    std = residual / float(np.sqrt(np.mean(x * x) * independent))
    return Line(gain, std, 0.0, 0.0, residual, 1.0)


def _lag(model: Array, real: Array) -> Lag | None:
    """Return how much the model's turning lags behind the car's, None where unknown.

    An offset is fitted too: on the way into a bend it looks like a lag.
    """
    known = np.isfinite(model) & np.isfinite(real)
    if known.sum() < 10 or float(np.ptp(model[known])) < _LEAST_SWING_PM:
        return None
    pair = delayed_line(real, model, longest_s=_LONGEST_LAG_S)
    at_once = _line(real, model)
    changes = _line(real, np.gradient(real) / PERIOD_S)
    if pair is None or at_once is None or changes is None:
        return None
    # What a lag changes beyond what gain and offset could.
    tells = abs(pair.line.gain) * changes.residual * np.sqrt(known.sum() * PERIOD_S / TOGETHER_S)
    std_s = pair.line.residual / max(float(tells), 1e-9)
    helps = pair.line.residual**2 < 0.5 * at_once.residual**2
    # Into a bend that goes on, any lag fits with a gain and an offset that make up for it.
    alike = abs(pair.line.gain - 1.0) < _GAIN_OF_A_LAG
    return Lag(pair.delay_s if helps and alike else 0.0, std_s)


_SHARE = 0.25
"""Of the mean departure: what counts as one."""
_LATE_S, _USUAL_LAG_S = 0.36, 0.1
"""A delay that is itself the departure is no lag to be allowed for."""
_COMPARED = {
    "speed": ("ground_mps", "wheel_mps", False),
    "gyro": ("course_radps", "gyro_radps", False),
    "model": ("commanded_rad", "model_tire_rad", True),
    "measured": ("asked_rad", "done_rad", True),
    "motion_by_angle": ("done_rad", "arc_rad", False),
    "": ("by_measured_pm", "curvature_pm", False),
}
"""By the beginning of a piece of evidence's name: two signals, and whether one lags."""


def began_ns(pairs: SignalPairs, seen: Consistency, evidence: str) -> int:
    """Return since when the pair behind a piece of evidence has departed from agreement.

    The change point of Page's test (1954): where the sum of what departs beyond its allowance was
    last at its lowest.
    """
    pairs = _followable(pairs)
    x_name, y_name, lags = next(
        row for prefix, row in _COMPARED.items() if evidence.startswith(prefix)
    )
    x, y = getattr(pairs, x_name), getattr(pairs, y_name)
    lag_s = 0.0
    if lags and seen.measured_by_command is not None:
        delay_s = seen.measured_by_command.delay_s
        lag_s = delay_s if delay_s < _LATE_S else _USUAL_LAG_S
    late = round(lag_s / PERIOD_S)
    apart = np.nan_to_num(y[late:] - x[: len(x) - late])
    return int(pairs.stamp_ns[late + change_index(np.asarray(apart**2))])


def change_index(departure: Array) -> int:
    """Return the index (N,) from which a departure, which is never negative, has been there."""
    summed = np.cumsum(departure - _SHARE * float(np.mean(departure)))
    lowest = int(np.argmin(np.concatenate([[0.0], summed[:-1]])))
    return min(lowest, len(departure) - 1)
