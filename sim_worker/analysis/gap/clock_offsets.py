"""By how much a car's own samples are stamped later than those of its inertial unit.

Speed and steering come over buses and adapters, which take their time, and are filtered on the way;
telemetry has no clock that all of them share. What each says is compared with the unit by how it
changes: levels say nothing of time.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from msgspec.structs import replace

from foretwin.contracts.arrays import Array
from foretwin.geometry.shifted_fit import shifted, shifted_fit
from foretwin.sim_worker.analysis.gap.pairs import FASTEST_MPS, smooth
from foretwin.sim_worker.analysis.motion_record import PERIOD_S, MotionRecord

_GROUND_OVER_S = 0.4
"""Speed over ground is that between positions so far apart."""
_OVER_S = (0.4, 0.8)
"""Changes are taken over these: both must say the same, else the difference is doubt."""
_ROLLS_MPS, _SURE = 0.5, 1.96
_GRID_S = PERIOD_S / math.sqrt(12.0)
"""Signals are compared on a grid and held for a tick: so much of a time stays open (standard
deviation of what is anywhere in a tick)."""
_PITCH_S = 0.015
"""A body that pitches as it is braked shows the unit a share of gravity, later: with the stand-in,
speeds look 25 ms early for it."""
_TAKEN_S = 0.1
"""Clocks so far apart accuse nobody: nothing needs to be moved for them."""
_GAIN_STD = 0.3
"""How far what a sensor shows may be off in size, while only its time is sought."""


class ClockOffset(NamedTuple):
    """Samples are stamped `late_s` later than the inertial unit's, with a standard deviation.

    1.96 of `std_s` hold 95 of 100, also where few stretches of driving tell it.
    """

    late_s: float
    std_s: float


def on_one_clock(
    samples: Sequence[tuple[str, Any]], offsets: Mapping[str, ClockOffset | None]
) -> list[tuple[str, Any]]:
    """Return a drive's samples stamped as the inertial unit's, in the order of their stamps.

    `offsets` are by channel. One within 1.96 of its standard deviations of 0 is let be.
    """
    late_ns = {channel: round(late_s * 1e9) for channel, late_s in moved_s(offsets).items()}
    moved = [
        (channel, replace(message, stamp_ns=message.stamp_ns - late_ns[channel]))
        if channel in late_ns
        else (channel, message)
        for channel, message in samples
    ]
    return sorted(moved, key=lambda one: one[1].stamp_ns)


def moved_s(offsets: Mapping[str, ClockOffset | None]) -> dict[str, float]:
    """Return by how much `on_one_clock` moves which channels."""
    return {
        channel: offset.late_s
        for channel, offset in offsets.items()
        if offset is not None and abs(offset.late_s) > _SURE * offset.std_s
    }


def apart_from_commands(
    steering: ClockOffset, *, speed: ClockOffset | None, gnss: ClockOffset | None
) -> dict[str, ClockOffset | None]:
    """Return by how much channels of a commanded car are stamped later than its commands, of those
    that surely are so by more than verdicts take in their stride.

    All are given as later than the inertial unit. It is the one that is late where steering and
    speed agree on that; how late steering alone is may as well be how the model turns.
    """
    unit_s = 0.0
    if speed is not None and _is_far(steering) and _is_far(speed):
        unit_s = -speed.late_s if abs(speed.late_s - steering.late_s) < _TAKEN_S else 0.0
    std_s = 0.0 if speed is None else speed.std_s
    late = {"speed": speed, "gnss": gnss}
    moved = {
        name: None if one is None else one._replace(late_s=one.late_s + unit_s)
        for name, one in late.items()
    }
    found = {**moved, "imu": ClockOffset(unit_s, std_s)}
    return {name: one for name, one in found.items() if one is not None and _is_far(one)}


def _is_far(offset: ClockOffset) -> bool:
    return abs(offset.late_s) - _SURE * offset.std_s > _TAKEN_S


def on_tick(column: Array, shift_s: float) -> Array:
    """Return a signal (N,) of the record's grid as it comes `shift_s` later."""
    return shifted(column, shift_s, period_s=PERIOD_S)


def speed_offset(record: MotionRecord) -> ClockOffset | None:
    """Return the offset of speeds, from the acceleration ahead; None where nothing tells it."""
    speed = np.where(record.speed_mps > _ROLLS_MPS, record.speed_mps, np.nan)
    known = np.isfinite(record.accel_x_mps2)
    push = np.where(known, record.accel_x_mps2, 0.0)
    gained = (np.cumsum(push) - 0.5 * push) * PERIOD_S
    return _offset(np.where(known, gained, np.nan), speed, open_s=math.hypot(_GRID_S, _PITCH_S))


def turning_offset(gyro_radps: Array, turning_radps: Array) -> ClockOffset | None:
    """Return the offset of what makes a model turn (N,), from how the gyro (N,) changes."""
    return _offset(gyro_radps, turning_radps, open_s=_GRID_S)


def position_offset(record: MotionRecord, speed: ClockOffset) -> ClockOffset | None:
    """Return the offset of positions, from the speed over ground that they make.

    `speed` is that of the speeds that they are compared with, whose doubt comes in.
    """
    half = round(0.5 * _GROUND_OVER_S / PERIOD_S)
    gone = np.hypot(_change(record.x_m, half), _change(record.y_m, half))
    ground = gone / (2 * half * PERIOD_S)
    # A fix that leaps says nothing of time.
    ground = np.where((ground > _ROLLS_MPS) & (ground < FASTEST_MPS), ground, np.nan)
    wheels = smooth(on_tick(record.speed_mps, -speed.late_s), half)
    found = _offset(np.where(wheels > _ROLLS_MPS, wheels, np.nan), ground, open_s=_GRID_S)
    return None if found is None else found._replace(std_s=math.hypot(found.std_s, speed.std_s))


def _offset(unit: Array, sensor: Array, *, open_s: float) -> ClockOffset | None:
    found = []
    for over_s in _OVER_S:
        half = round(0.5 * over_s / PERIOD_S)
        # What drifts steadily, as a slope's share of gravity does, is the same at all times.
        columns = np.stack([_change(sensor, half), np.ones(len(sensor))], axis=1)
        fit = shifted_fit(
            _change(unit, half),
            columns,
            period_s=PERIOD_S,
            around=np.array([1.0, 0.0]),
            prior_std=np.array([_GAIN_STD, np.inf]),
        )
        if fit is None or fit.at_the_end:
            return None
        found.append((float(fit.half_widths[-1]) / _SURE, -fit.shift_s))
    std_s, late_s = min(found)
    apart_s = max(abs(late_s - other) for _, other in found)
    return ClockOffset(late_s, math.hypot(std_s, 0.5 * apart_s, open_s))


def _change(values: Array, half: int) -> Array:
    out = np.full(len(values), np.nan)
    if len(values) > 2 * half:
        out[half:-half] = values[2 * half :] - values[: -2 * half]
    return out
