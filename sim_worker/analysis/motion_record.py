"""What a drive's samples say at even instants: the ground of identification and of the gap.

Sensors send at their own rates; comparing them needs one grid. Measured signals are interpolated
between neighbours, commands hold until the next one, and what lies in a gap is NaN rather than
invented.
"""

from __future__ import annotations

import math
from collections import deque
from typing import Any, NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array, Flags, Stamps
from foretwin.contracts.drive import (
    ControlCommand,
    GnssFix,
    HeadingSample,
    ImuSample,
    SpeedSample,
    SteeringSample,
    VehicleStatus,
)
from foretwin.contracts.frames import LocalFrame, local_from_geo, local_from_geo_yaw
from foretwin.sim_worker.vehicle.commands import HELD_NS

PERIOD_S = 0.02


class MotionRecord(NamedTuple):
    """Signals at N even instants; NaN where a sensor is absent or silent for too long.

    Positions are those of the antenna in the given local frame; the yaw rate and the specific
    force ahead are the body's; steering as measured (wheel, tyre) and as commanded, positive to the
    left. `command_age_s` is how long the commands have held, `manual` where a human drives.
    """

    stamp_ns: Stamps
    x_m: Array
    y_m: Array
    altitude_m: Array
    yaw_rad: Array
    speed_mps: Array
    yaw_rate_radps: Array
    accel_x_mps2: Array
    wheel_rad: Array
    tire_rad: Array
    command_accel_mps2: Array
    command_wheel_rad: Array
    command_tire_rad: Array
    command_age_s: Array
    manual: Flags

    @property
    def time_s(self) -> Array:
        """Seconds since the first instant, shape (N,)."""
        return np.asarray((self.stamp_ns - self.stamp_ns[0]) * 1e-9)

    def has(self, name: str) -> bool:
        """Return whether a signal is known at half of the instants at least."""
        return bool(np.isfinite(getattr(self, name)).mean() >= 0.5)


_MEASURED = {
    "gnss": ("x_m", "y_m", "altitude_m"),
    "heading": ("yaw_rad",),
    "speed": ("speed_mps",),
    "imu": ("yaw_rate_radps", "accel_x_mps2"),
    "steering": ("wheel_rad", "tire_rad"),
}
_HELD = {"control": ("command_accel_mps2", "command_wheel_rad", "command_tire_rad")}
_GAP_S = {
    "gnss": 2.5,
    "heading": 0.5,
    "speed": 0.3,
    "imu": 0.2,
    "steering": 0.3,
    "control": HELD_NS / 1e9,
}
"""Two neighbours further apart than this leave a gap."""


class MotionRecorder:
    """Keeps the last `keep_s` seconds of a vehicle's samples, and lays them on a grid when asked.

    `handle` takes (channel, message) in any order; bounded whatever comes.
    """

    def __init__(self, *, frame: LocalFrame, keep_s: float = 120.0, depth: int = 60_000) -> None:
        self._frame = frame
        self._keep_ns = round(keep_s * 1e9)
        channels = (*_MEASURED, *_HELD, "status")
        self._rows: dict[str, deque[tuple[float, ...]]] = {
            name: deque(maxlen=depth) for name in channels
        }
        self._newest_ns: int | None = None
        self._base_ns = 0

    @property
    def newest_stamp_ns(self) -> int | None:
        """The newest stamp taken, None before the first."""
        return self._newest_ns

    def handle(self, channel: str, message: Any) -> None:
        """Take one sample; other channels and numbers that are not finite are passed over."""
        values = self._values(message)
        if values is None or channel not in self._rows or not np.isfinite(values).any():
            return
        stamp_ns = message.stamp_ns
        if self._newest_ns is None:
            self._base_ns = stamp_ns
        rows = self._rows[channel]
        rows.append(((stamp_ns - self._base_ns) * 1e-9, *values))
        self._newest_ns = stamp_ns if self._newest_ns is None else max(stamp_ns, self._newest_ns)
        oldest_s = (self._newest_ns - self._base_ns - self._keep_ns) * 1e-9
        while rows and rows[0][0] < oldest_s:
            rows.popleft()

    def _values(self, message: Any) -> tuple[float, ...] | None:
        match message:
            case GnssFix(position=place):
                x, y = local_from_geo(self._frame, place.lat_deg, place.lon_deg)
                return float(x), float(y), place.alt_m
            case HeadingSample(yaw_rad=yaw):
                origin = self._frame.origin
                return (
                    float(local_from_geo_yaw(self._frame, yaw, origin.lat_deg, origin.lon_deg)),
                )
            case SpeedSample(speed_mps=speed):
                return (speed,)
            case ImuSample(rate_radps=rate, accel_mps2=accel):
                return rate[2], accel[0] if message.tells_force else math.nan
            case SteeringSample(steering_wheel_rad=wheel, tire_angle_rad=tire):
                return _or_nan(wheel), _or_nan(tire)
            case ControlCommand(accel_mps2=accel, steering_wheel_rad=wheel, tire_angle_rad=tire):
                return accel, _or_nan(wheel), _or_nan(tire)
            case VehicleStatus(control_mode=mode):
                return (float(mode == "manual"),)
            case _:
                return None

    def record(
        self,
        from_stamp_ns: int | None = None,
        to_stamp_ns: int | None = None,
        *,
        period_s: float = PERIOD_S,
    ) -> MotionRecord:
        """Return what is known between two stamps (by default of all that is kept), both included.

        Raises ValueError before the first sample or for an end before the beginning.
        """
        if self._newest_ns is None:
            raise ValueError("no sample has come yet")
        kept = [rows[0][0] for name, rows in self._rows.items() if rows and name != "status"]
        oldest_ns = self._base_ns + round(min(kept, default=0.0) * 1e9)
        first = oldest_ns if from_stamp_ns is None else from_stamp_ns
        last = self._newest_ns if to_stamp_ns is None else to_stamp_ns
        if last < first:
            raise ValueError(f"the end, {last} ns, lies before the beginning, {first} ns")
        stamps = np.arange(first, last + 1, round(period_s * 1e9), dtype=np.int64)
        at = np.asarray((stamps - self._base_ns) * 1e-9, dtype=np.float64)
        columns: dict[str, Array] = {}
        for channel, names in (_MEASURED | _HELD).items():
            table = self._table(channel, 1 + len(names))
            for index, name in enumerate(names, start=1):
                known = table[np.isfinite(table[:, index])]
                if name == "yaw_rad":
                    known[:, index] = np.unwrap(known[:, index])
                read = _held if channel in _HELD else between_samples
                columns[name] = read(known[:, 0], known[:, index], at, gap_s=_GAP_S[channel])
        commands = self._table("control", 4)[:, 0]
        columns["command_age_s"] = at - _held(commands, commands, at, gap_s=_GAP_S["control"])
        told = self._table("status", 2)
        manual = _held(told[:, 0], told[:, 1], at, gap_s=np.inf)
        return MotionRecord(stamp_ns=stamps, manual=manual == 1.0, **columns)

    def _table(self, channel: str, width: int) -> Array:
        rows = self._rows[channel]
        table = np.array(rows, dtype=np.float64).reshape(len(rows), width)
        # Late samples came out of order; of two with one stamp the first counts.
        _, index = np.unique(table[:, 0], return_index=True)
        return table[index]


def _or_nan(value: float | None) -> float:
    return math.nan if value is None else value


def between_samples(time_s: Array, values: Array, at_s: Array, *, gap_s: float) -> Array:
    """Return (N,) values at `at_s`, linear between samples (K,) in time order.

    NaN outside of them, and between two that lie more than `gap_s` apart.
    """
    if len(time_s) < 2:
        return np.full(len(at_s), np.nan)
    after = np.clip(np.searchsorted(time_s, at_s), 1, len(time_s) - 1)
    apart = time_s[after] - time_s[after - 1]
    inside = (at_s >= time_s[0]) & (at_s <= time_s[-1]) & (apart <= gap_s)
    return np.where(inside, np.interp(at_s, time_s, values), np.nan)


def _held(time_s: Array, values: Array, at_s: Array, *, gap_s: float) -> Array:
    if not len(time_s):
        return np.full(len(at_s), np.nan)
    index = np.searchsorted(time_s, at_s, side="right") - 1
    age = at_s - time_s[np.maximum(index, 0)]
    return np.where((index >= 0) & (age <= gap_s), values[np.maximum(index, 0)], np.nan)
