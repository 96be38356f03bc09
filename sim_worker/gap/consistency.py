"""Which signals of a stretch of driving agree with which: commands, actuators, motion, model.

The model enters by its signals alone, the answers of its free runs to what the car was told and
to what its actuators were measured to do. Nothing here reads a parameter to compare it with
another; ratio and offset only turn steering wheels into tyres.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from contracts.arrays import Array
from sim_worker.gap.fitting import Follower, Line, follower, line_through
from sim_worker.gap.free_run import FreeRunner, start_states, steering_signals
from sim_worker.motion_record import PERIOD_S, MotionRecord

_Flags = np.ndarray[Any, np.dtype[np.bool_]]
_Indices = np.ndarray[Any, np.dtype[np.intp]]
_RUN, _HALF = round(1.0 / PERIOD_S), round(0.5 / PERIOD_S)
_MOVES_MPS, _ROLLS_MPS = 2.5, 0.5
"""Above them turning, and acceleration alone, say something."""
_BEND_RADPS = 0.08
"""Standard deviation of a rate that varies enough to show a gain."""
_COURSE_HALF = round(0.3 / PERIOD_S)
_MIN_TURN_RAD, _MIN_ACCEL_MPS2 = 0.012, 0.25
_COMMAND_LAG = round(0.1 / PERIOD_S)


class Push(NamedTuple):
    """Accelerations (K,) over half seconds: commanded, the car's, the model's; and the speeds."""

    commanded_mps2: Array
    car_mps2: Array
    model_mps2: Array
    speed_mps: Array


class Consistency(NamedTuple):
    """What a stretch says of each pair; None where it says found.

    Steering lines are in tyre angles as the model reads them, turns in curvature: offsets of
    `motion_by_model` are 1/m.
    """

    gyro_by_course: Line | None
    speed_by_gnss: Line | None
    measured_by_command: Follower | None
    model_by_command: Follower | None
    motion_by_measured: Line | None
    motion_by_measured_hard: Line | None
    """The same where the lateral acceleration is high."""
    motion_lag_s: float
    """By how much the model's turning lags behind the car's, NaN where unknown."""
    motion_by_command: Line | None
    motion_by_angle: Line | None
    """Kinematic tyre angle of the motion over the measured one: free of the model's limits."""
    push: Push | None
    excited_s: float
    pushed_s: float
    moved_s: float


def consistency_of(
    record: MotionRecord,
    runner: FreeRunner,
    *,
    antenna_ahead_m: float = 0.0,
    precise_positions: bool = True,
) -> Consistency:
    """Compare the signals of one stretch (some seconds) pair by pair.

    Without precise positions no sensor is judged by them: a telephone's are smoothed and late.
    """
    signals = steering_signals(record, runner.vehicle)
    speed, rate = record.speed_mps, record.yaw_rate_radps
    moves = np.isfinite(speed) & (speed > _MOVES_MPS)
    turn = np.nanmax(np.stack([np.abs(np.nan_to_num(x)) for x in signals]), axis=0)
    turn = np.maximum(turn, np.nan_to_num(2.5 * np.abs(rate) / np.maximum(speed, _MOVES_MPS)))
    excited = moves & (turn > _MIN_TURN_RAD)
    rolls = np.isfinite(speed) & (speed > _ROLLS_MPS)
    pushed = rolls & (np.abs(np.nan_to_num(record.command_accel_mps2)) > _MIN_ACCEL_MPS2)
    gyro, gnss_speed = None, None
    if precise_positions:
        gyro, gnss_speed = _sensors(record, antenna_ahead_m)
    wheel = np.isfinite(record.command_wheel_rad).any() and np.isfinite(record.wheel_rad).any()
    # At the steering wheel where both are: no ratio comes in.
    ratio = runner.vehicle.steering_ratio.value
    asked = record.command_wheel_rad / ratio if wheel else signals.commanded_rad
    done = record.wheel_rad / ratio if wheel else signals.measured_rad
    measured = None
    if _varies(asked) or _varies(done):
        measured = follower(np.where(moves, asked, np.nan), np.where(moves, done, np.nan))
    angle = None
    if _varies(done):
        arc = np.arctan(runner.vehicle.wheelbase_m.value * rate / np.maximum(speed, _MOVES_MPS))
        known = moves & np.isfinite(done) & np.isfinite(arc)
        angle = line_through(done[known], arc[known], independent=known.sum() * PERIOD_S / 0.3)
    turned = _turning(record, runner, rolls & np.isfinite(rate))
    return Consistency(
        gyro_by_course=gyro,
        speed_by_gnss=gnss_speed,
        measured_by_command=measured,
        motion_by_angle=angle,
        excited_s=float(excited.sum()) * PERIOD_S,
        pushed_s=float(pushed.sum()) * PERIOD_S,
        moved_s=float(moves.sum()) * PERIOD_S,
        **turned,  # type: ignore[arg-type]
    )


def _varies(angle: Array) -> bool:
    known = angle[np.isfinite(angle)]
    return len(known) > 50 and bool(np.ptp(known) > _MIN_TURN_RAD)


def _smooth(values: Array, half: int) -> Array:
    """Mean over 2 half + 1 samples; NaN at the ends and near gaps."""
    out = np.full(len(values), np.nan)
    if len(values) > 2 * half:
        kernel = np.full(2 * half + 1, 1.0 / (2 * half + 1))
        out[half : len(values) - half] = np.convolve(values, kernel, mode="valid")
    return out


def _sensors(record: MotionRecord, ahead_m: float) -> tuple[Line | None, Line | None]:
    """Compare gyro and wheel speed with what the positions say."""
    half = _COURSE_HALF
    count = len(record.x_m)
    if count < 4 * _HALF:
        return None, None
    dx, dy = np.full(count, np.nan), np.full(count, np.nan)
    dx[half : count - half] = record.x_m[2 * half :] - record.x_m[: count - 2 * half]
    dy[half : count - half] = record.y_m[2 * half :] - record.y_m[: count - 2 * half]
    gone = np.hypot(dx, dy) / (2 * half * PERIOD_S)
    speed = _smooth(record.speed_mps, half)
    at = np.arange(0, count, 5)
    seconds = len(at) * 5 * PERIOD_S
    known = np.isfinite(gone[at]) & np.isfinite(speed[at]) & (gone[at] > _MOVES_MPS)
    share = seconds / len(at)
    by_speed = None
    if known.sum() * share > 1.5:
        by_speed = _mean_ratio(gone[at][known], speed[at][known], share)
    rate = record.yaw_rate_radps
    steady = np.where(np.isfinite(rate) & (gone > _MOVES_MPS), rate, np.nan)
    course = np.arctan2(dy, dx)
    fine = np.isfinite(course) & np.isfinite(steady)
    course[fine] = np.unwrap(course[fine])
    course = course - np.arctan2(ahead_m * _smooth(steady, half), gone)
    ahead = np.full(count, np.nan)
    ahead[_HALF // 2 : count - _HALF // 2] = (
        course[2 * (_HALF // 2) :] - course[: count - 2 * (_HALF // 2)]
    ) / (2 * (_HALF // 2) * PERIOD_S)
    gyro = _smooth(_smooth(steady, half), _HALF // 2)
    known = np.isfinite(ahead[at]) & np.isfinite(gyro[at]) & (np.abs(ahead[at]) < 1.5)
    by_course = None
    if known.sum() * share > 1.5:
        by_course = _turn_rates(ahead[at][known], gyro[at][known], share)
    return by_course, by_speed


def _turn_rates(course: Array, gyro: Array, share: float) -> Line | None:
    """Fit the gyro over the course's rate; without a bend, whose rate is noise, its bias alone."""
    independent = max(len(course) * share / 0.4, 2.0)
    if max(float(np.std(gyro)), 0.6 * float(np.std(course))) > _BEND_RADPS:
        return line_through(course, gyro, independent=independent)
    apart = gyro - course
    std = float(np.std(apart))
    return Line(1.0, np.inf, float(np.mean(apart)), std / np.sqrt(independent), std, 0.0)


def _mean_ratio(x: Array, y: Array, share: float) -> Line:
    """Fit y = gain x: speeds vary too little in a few seconds to part an offset from a gain."""
    gain = float(np.sum(x * y) / np.sum(x * x))
    left = y - gain * x
    independent = max(len(x) * share / 0.4, 2.0)
    residual = float(np.sqrt(np.sum(left * left) / (len(x) - 1)))
    std = residual / float(np.sqrt(np.mean(x * x) * independent))
    return Line(gain, std, 0.0, 0.0, residual, 1.0)


def _turning(record: MotionRecord, runner: FreeRunner, usable: _Flags) -> dict[str, object]:
    """Run the model over the stretch and compare its turning and its acceleration."""
    signals = steering_signals(record, runner.vehicle)
    found: dict[str, object] = {
        "model_by_command": None, "motion_by_measured": None, "motion_by_measured_hard": None,
        "motion_lag_s": float("nan"), "motion_by_command": None, "push": None,
    }  # fmt: skip
    starts = _starts(usable)
    if not len(starts):
        return found
    speed, rate = record.speed_mps, record.yaw_rate_radps
    smooth = np.where(np.isfinite(_smooth(speed, 3)), _smooth(speed, 3), speed)
    accel = np.gradient(smooth) / PERIOD_S
    zero = np.zeros(len(starts))
    turns = np.array([(speed[s : s + _RUN + 1] > _MOVES_MPS).all() for s in starts])
    begin = start_states(
        runner.vehicle, x_m=zero, y_m=zero, yaw_rad=zero, speed_mps=smooth[starts],
        yaw_rate_radps=rate[starts], accel_mps2=accel[starts],
        tire_rad=np.full(len(starts), np.nan),
    )  # fmt: skip
    slow_too, begin_all = starts, begin
    starts, begin = starts[turns], begin[turns]
    window = (starts[:, None] + np.arange(_RUN - _HALF + 1, _RUN + 1)[None, :]).ravel()
    real = rate[window] / speed[window]
    independent = len(window) * PERIOD_S / 0.3
    hard = np.abs(rate[window] * speed[window]) > 1.2
    if len(starts) and np.isfinite(signals.measured_rad[window]).all():
        runs = runner.run(
            states=begin, starts=starts, steps=_RUN, accel_mps2=record.command_accel_mps2,
            tire_rad=signals.measured_rad, hold_speed_mps=smooth, delayed=False,
        )  # fmt: skip
        tail = runs[:, _HALF + 1 :]
        model = (tail[:, :, 5] / np.maximum(tail[:, :, 3], 1.0)).ravel()
        if np.ptp(real) > 0.006 or np.ptp(model) > 0.006:
            found["motion_by_measured"] = line_through(model, real, independent=independent)
            if hard.sum() * PERIOD_S > 0.6:
                found["motion_by_measured_hard"] = _mean_ratio(model[hard], real[hard], PERIOD_S)
        found["motion_lag_s"] = _lag(model.reshape(len(starts), -1), starts, record)
    command = record.command_accel_mps2
    span = slice(int(slow_too[0]), int(slow_too[-1]) + _RUN + 1)
    if np.isfinite(signals.commanded_rad[span]).all() and np.isfinite(command[span]).all():
        runs = runner.run(
            states=begin_all, starts=slow_too, steps=_RUN, accel_mps2=command,
            tire_rad=signals.commanded_rad,
        )  # fmt: skip
        tail = runs[turns, _HALF + 1 :]
        model = (tail[:, :, 5] / np.maximum(tail[:, :, 3], 1.0)).ravel()
        if len(starts) and (np.ptp(real) > 0.006 or np.ptp(model) > 0.006):
            found["motion_by_command"] = line_through(model, real, independent=independent)
        tyre = np.full(len(usable), np.nan)
        tyre[window] = tail[:, :, 6].ravel()
        if _varies(signals.commanded_rad):
            found["model_by_command"] = follower(signals.commanded_rad, tyre)
        found["push"] = _push(record, smooth, slow_too, runs)
    return found


def _starts(usable: _Flags) -> _Indices:
    """Return where runs begin, half a run apart at least, so that all of each is usable."""
    chosen: list[int] = []
    clear = np.concatenate([[0], np.cumsum(~usable)])
    first = 0
    while first + _RUN < len(usable):
        if clear[first + _RUN + 1] > clear[first]:
            first += 1
            continue
        chosen.append(first)
        first += _HALF
    return np.array(chosen, dtype=np.intp)


def _push(record: MotionRecord, speed: Array, starts: _Indices, runs: Array) -> Push:
    """Compare what car and model gain over the second half of each run."""
    pace = _HALF * PERIOD_S
    gained = (runs[:, -1, 3] - runs[:, _RUN - _HALF, 3]) / pace
    went = (speed[starts + _RUN] - speed[starts + _RUN - _HALF]) / pace
    asked = [
        np.mean(record.command_accel_mps2[s + _HALF - _COMMAND_LAG : s + _RUN - _COMMAND_LAG])
        for s in starts
    ]
    return Push(np.array(asked), went, gained, speed[starts + _HALF])


def _lag(model: Array, starts: _Indices, record: MotionRecord) -> float:
    """Return how much the model's turning lags behind the car's, by the best common shift."""
    curvature = record.yaw_rate_radps / np.maximum(record.speed_mps, 1.0)
    errors = []
    shifts = range(-10, 21)
    width = model.shape[1]
    for shift in shifts:
        at = starts[:, None] + _RUN - _HALF + 1 + np.arange(width)[None, :] - shift
        if at.max() >= len(curvature) or at.min() < 0:
            errors.append(np.inf)
            continue
        other = curvature[at].ravel()
        flat = model.ravel()
        scale = float(np.sum(flat * other) / max(np.sum(flat * flat), 1e-12))
        errors.append(float(np.mean((other - scale * flat) ** 2)))
    best = int(np.argmin(errors))
    unshifted = errors[10]
    if not np.isfinite(unshifted) or errors[best] > 0.5 * unshifted or np.ptp(model) < 0.02:
        return 0.0 if np.ptp(model) >= 0.02 else float("nan")
    return shifts[best] * PERIOD_S
