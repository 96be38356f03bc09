"""The signals of a stretch of driving side by side: commands, actuators, motion, model.

The model enters by its signals alone, the answers of its free runs to what the car was told and
to what its actuators were measured to do. Nothing here reads a parameter to compare it with
another; ratio and offset only turn steering wheels into tyres.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array, Flags, Indices, Stamps
from foretwin.sim_worker.analysis.gap.between_commands import SELDOM_S, between_commands
from foretwin.sim_worker.analysis.gap.free_run import (
    MIN_TURN_RAD,
    FreeRunner,
    RunMemory,
    outrun,
    start_states,
    tire_angles,
)
from foretwin.sim_worker.analysis.gap.measured_motion import MeasuredMotion
from foretwin.sim_worker.analysis.gap.push_blocks import BLOCK, PushBlocks, push_blocks
from foretwin.sim_worker.analysis.identify.road_grade import climb_under
from foretwin.sim_worker.analysis.motion_record import PERIOD_S, MotionRecord

_ALIKE = 2.0
"""Root of how many blocks in a row a map's grade errs alike: it does over some 80 m. Chosen."""
_RUN, _TAIL = round(1.0 / PERIOD_S), 2 * BLOCK
"""A run lasts a second, the end of which is compared: where it began is forgotten by then."""
_SETTLED = round(0.4 / PERIOD_S)
"""A run that ended so long ago has all of its samples, from slow and late senders too."""
_SMOOTH_HALF, _COURSE_HALF, _TURN_HALF = 3, round(0.3 / PERIOD_S), round(0.24 / PERIOD_S)
MOVES_MPS, _ROLLS_MPS = 2.5, 0.5
"""Above them turning, and acceleration and speed alone, say something."""
_FULL_LOCK_RAD = 0.36
"""Sharper, on less than 7 m, tyres scrub and steering runs out of its line: no model is right, and
what departs there accuses nobody. Chosen: a car of 2.4 m/s at 0.5 rad lost all of 0.6 m/s²."""
_MOST_ACROSS_MPS2 = 15.0
"""No tyre of the road carries more: from a gyro that says so no model can begin."""
FASTEST_MPS, _HARDEST_MPS2 = 80.0, 15.0
"""No car's, twice what tyres do: positions that leap say nothing of its sensors."""


class SignalPairs(NamedTuple):
    """Signals on the grid, each (N,) and NaN where unknown; steering in tyre angles.

    `asked_rad` and `done_rad` are steering as commanded and as measured, from the steering wheel
    where both are known there, so that no ratio comes in.
    """

    stamp_ns: Stamps
    moves: Flags
    excited: Flags
    """Moves and turns."""
    course_radps: Array
    """Rate of the course over ground; then the gyro smoothed alike."""
    gyro_radps: Array
    ground_mps: Array
    """Speed over ground; then the measured speed smoothed alike."""
    wheel_mps: Array
    asked_rad: Array
    done_rad: Array
    arc_rad: Array
    """Tyre angle of a bicycle without slip that turns as the car does."""
    speed_mps: Array
    curvature_pm: Array
    """The car's; then the model's at the measured steering, and under the commands."""
    by_measured_pm: Array
    by_command_pm: Array
    commanded_rad: Array
    """As the model reads the command; then what its tyres do."""
    model_tire_rad: Array
    pushes: PushBlocks
    too_fast: Flags
    """Tyres that turn as fast as the vehicle's can are not yet where they are commanded to."""
    rare: Flags
    """Between two commands others may have been sent."""

    @property
    def broken(self) -> bool:
        """Whether steering is lost somewhere since it was first known, the car not standing, or
        what it was told is known now and then alone."""
        if self.rare.any():
            return True
        known = np.isfinite(self.asked_rad) & np.isfinite(self.done_rad)
        lost = ~known & ~(self.speed_mps < MOVES_MPS)
        return bool(lost[int(np.argmax(known)) :].any()) if known.any() else False

    def latest(self, seconds: float) -> SignalPairs:
        """Return the signals of the latest seconds, with all of the pushes."""
        kept = slice(max(0, len(self.stamp_ns) - round(seconds / PERIOD_S)), None)
        columns = {name: getattr(self, name)[kept] for name in self._fields if name != "pushes"}
        return self._replace(**columns)


def pairs_of(
    record: MotionRecord,
    runner: FreeRunner,
    *,
    antenna_ahead_m: float = 0.0,
    precise_positions: bool = True,
    memory: RunMemory | None = None,
) -> SignalPairs:
    """Lay the signals of some seconds side by side and run the model over them.

    `memory` is that of earlier stretches of the same drive with the same runner. Without precise
    positions no sensor is compared with them: a telephone's are smoothed and late.
    """
    signals = tire_angles(record, runner.vehicle)
    speed, rate = record.speed_mps, record.yaw_rate_radps
    moves = np.isfinite(speed) & (speed > MOVES_MPS)
    turn = np.nanmax(np.stack([np.abs(np.nan_to_num(x)) for x in signals]), axis=0)
    turn = np.maximum(turn, np.nan_to_num(2.5 * np.abs(rate) / np.maximum(speed, MOVES_MPS)))
    wheel = np.isfinite(record.command_wheel_rad).any() and np.isfinite(record.wheel_rad).any()
    ratio = runner.vehicle.steering_ratio.value
    asked = record.command_wheel_rad / ratio if wheel else signals.commanded_rad
    done = record.wheel_rad / ratio if wheel else signals.measured_rad
    between = between_commands(record.command_age_s)
    asked, commanded = (between.of(one) for one in (asked, signals.commanded_rad))
    arc = np.arctan(runner.vehicle.wheelbase_m.value * rate / np.maximum(speed, MOVES_MPS))
    sharp = np.abs(arc) > _FULL_LOCK_RAD
    sensors: dict[str, Any] = dict.fromkeys(_SENSORS, np.full(len(speed), np.nan))
    if precise_positions:
        sensors = sensor_signals(record, antenna_ahead_m)
    return SignalPairs(
        stamp_ns=record.stamp_ns,
        moves=moves,
        excited=moves & (turn > MIN_TURN_RAD) & ~sharp,
        asked_rad=np.where(moves, asked, np.nan),
        done_rad=np.where(moves, done, np.nan),
        arc_rad=np.where(moves, arc, np.nan),
        speed_mps=speed,
        curvature_pm=np.where(moves & ~sharp, rate / np.maximum(speed, MOVES_MPS), np.nan),
        commanded_rad=commanded,
        too_fast=outrun(asked, done, fastest_radps=runner.vehicle.max_tire_rate_radps.value),
        rare=between.rare,
        **sensors,
        **_runs(record, runner, memory or RunMemory(), sharp),
    )


def smooth(values: Array, half: int) -> Array:
    """Mean over 2 half + 1 samples; NaN at the ends and near gaps."""
    out = np.full(len(values), np.nan)
    if len(values) > 2 * half:
        kernel = np.full(2 * half + 1, 1.0 / (2 * half + 1))
        out[half : len(values) - half] = np.convolve(values, kernel, mode="valid")
    return out


def _change(values: Array, half: int) -> Array:
    """Return by how much values (N,) change over 2 half samples around each; NaN at the ends."""
    out, count = np.full(len(values), np.nan), len(values)
    if count > 2 * half:
        out[half : count - half] = values[2 * half :] - values[: count - 2 * half]
    return out


_SENSORS = ("course_radps", "gyro_radps", "ground_mps", "wheel_mps")


def sensor_signals(record: MotionRecord, ahead_m: float) -> dict[str, Array]:
    """Return rate of the course and gyro, speed over ground and of the wheels, each (N,).

    `record` is one of `PERIOD_S`, with its antenna `ahead_m` of the body's origin.
    """
    half = _COURSE_HALF
    dx, dy = _change(record.x_m, half), _change(record.y_m, half)
    gone = np.hypot(dx, dy) / (2 * half * PERIOD_S)
    surges = np.abs(np.gradient(gone)) / PERIOD_S > _HARDEST_MPS2
    leapt = (gone > FASTEST_MPS) | (np.convolve(surges, np.ones(4 * half + 1), "same") > 0.0)
    dx[leapt], gone[leapt] = np.nan, np.nan
    drives = gone > MOVES_MPS
    rate = np.where(drives, record.yaw_rate_radps, np.nan)
    course = np.arctan2(dy, dx)
    fine = np.isfinite(course) & np.isfinite(rate)
    course[fine] = np.unwrap(course[fine])
    course = course - np.arctan2(ahead_m * smooth(rate, half), gone)
    turns = _change(course, _TURN_HALF) / (2 * _TURN_HALF * PERIOD_S)
    turns = np.where(np.abs(turns) < 1.5, turns, np.nan)
    gyro = smooth(smooth(rate, half), _TURN_HALF)
    ground = np.where(gone > _ROLLS_MPS, gone, np.nan)
    found = (turns, gyro, ground, smooth(record.speed_mps, half))
    return dict(zip(_SENSORS, found, strict=True))


def _runs(
    record: MotionRecord, runner: FreeRunner, memory: RunMemory, sharp: Flags
) -> dict[str, Any]:
    """Return the model's curvature by measured steering and by command, its tyres, and pushes but
    where the car turns at full lock.

    Runs overlap so that their ends tile the stretch, back from its own end.
    """
    speed, rate = record.speed_mps, record.yaw_rate_radps
    known = record.command_age_s <= SELDOM_S
    accel = np.where(known, record.command_accel_mps2, np.nan)
    signals = tire_angles(record, runner.vehicle)
    count = len(speed)
    eased = smooth(speed, _SMOOTH_HALF)
    eased = np.where(np.isfinite(eased), eased, speed)
    rolls = np.isfinite(speed) & np.isfinite(rate) & (speed > _ROLLS_MPS)
    rolls &= np.abs(rate * speed) < _MOST_ACROSS_MPS2
    starts = np.arange(count - 1 - _SMOOTH_HALF - _RUN, -1, -_TAIL)[::-1]

    def throughout(known: Flags) -> Flags:
        unknown = np.concatenate([[0], np.cumsum(~known)])
        return np.asarray(unknown[starts + _RUN + 1] == unknown[starts], dtype=np.bool_)

    usable = throughout(rolls)
    turns = usable & throughout(speed > MOVES_MPS)
    measured = starts[turns & throughout(np.isfinite(signals.measured_rad))]
    told = usable & throughout(np.isfinite(signals.commanded_rad) & np.isfinite(accel))
    turned, told_starts = turns[told], starts[told]
    at = np.concatenate([measured, told_starts])
    by_measured, by_command, tire = (np.full(count, np.nan) for _ in range(3))
    found: dict[str, Any] = {
        "by_measured_pm": by_measured,
        "by_command_pm": by_command,
        "model_tire_rad": tire,
    }
    if not len(at):
        return {**found, "pushes": push_blocks(record, eased, at, np.zeros((0, 1)))}
    # What was measured has the actuator's lag in it; the model's own must not come on top.
    led = signals.measured_rad + runner.vehicle.steering_lag_s.value * (
        np.gradient(signals.measured_rad) / PERIOD_S
    )
    slope, nothing = np.gradient(eased) / PERIOD_S, np.full(count, np.nan)
    # One batch for both kinds: the stretch as commanded, then as measured with its speed held.
    held = np.arange(len(at)) < len(measured)

    climb = climb_under(record, runner.roads)

    def run(rows: Indices) -> Array:
        begun, zero = at[rows], np.zeros(len(rows))
        motion = MeasuredMotion(
            zero, zero, zero, eased[begun], rate[begun], slope[begun], zero, zero, zero
        )
        begin = start_states(runner.vehicle, motion, tire_rad=np.full(len(rows), np.nan))
        return runner.run(
            states=begin,
            starts=np.where(held[rows], begun + count, begun),
            steps=_RUN,
            accel_mps2=np.concatenate([accel, accel]),
            tire_rad=np.concatenate([signals.commanded_rad, led]),
            hold_speed_mps=np.concatenate([nothing, eased]),
            delayed=~held[rows],
            climb_mps2=None if climb is None else np.concatenate([climb.mps2, climb.mps2]),
        )

    states = memory.states(
        stamp_ns=record.stamp_ns[at],
        held=held,
        settled=at + _RUN + _SETTLED < count,
        from_stamp_ns=int(record.stamp_ns[0]),
        run=run,
    )
    tail = np.arange(_RUN - _TAIL + 1, _RUN + 1)
    curvature = states[:, tail, 5] / np.maximum(states[:, tail, 3], 1.0)
    by_measured[at[held][:, None] + tail] = curvature[held]
    commanded = np.flatnonzero(~held)[turned]
    by_command[at[commanded][:, None] + tail] = curvature[commanded]
    tire[at[commanded][:, None] + tail] = states[commanded][:, tail, 6]
    doubt = 0.0 if climb is None else _ALIKE * climb.std_mps2
    told_of = np.where(sharp, np.nan, eased)
    pushes = push_blocks(record, told_of, told_starts, states[~held][:, :, 3], doubt_mps2=doubt)
    return {**found, "pushes": pushes}
