"""Units, signs and times of a log's channels, proved by what its positions did meanwhile.

A proof lays a measured quantity beside the same one made of positions, both as means over the same
seconds. Where unit, sign and axes are right they correlate with a slope near 1, and where the
clocks agree they do so best near a lag of 0.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple

import msgspec
import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import LocalFrame, local_from_geo
from foretwin.telemetry.logs import Log

WINDOW_S = 1.0
_STEP_S = 0.1
_SLOWEST_MPS = 3.0
"""Slower than this positions tell no course."""
_LONGEST_GAP_S = 2.5
_MOST_LAG_S = 2.0


class Proof(NamedTuple):
    """How a measured quantity fits what the positions say.

    `slope` is the measured one per unit of the reference, at the lag where both correlate best;
    `lag_s` is positive where the measured one is stamped late; `seconds` is what was compared.
    """

    correlation: float
    slope: float
    lag_s: float
    seconds: float


class Signal(NamedTuple):
    """A quantity over time: seconds since the first position, and values (N,)."""

    time_s: Array
    values: Array


class MotionProof:
    """What a log's positions say of its other channels."""

    def __init__(self, log: Log, *, slowest_mps: float = _SLOWEST_MPS) -> None:
        self.found: dict[str, list[Any]] = {}
        for channel, message in log.samples():
            self.found.setdefault(channel, []).append(message)
        fixes = self.found["gnss"]
        self._zero_ns = fixes[0].stamp_ns
        lat, lon = (
            np.array([getattr(f.position, n) for f in fixes]) for n in ("lat_deg", "lon_deg")
        )
        xy = local_from_geo(LocalFrame(fixes[0].position), lat, lon)
        time_s = self.seconds("gnss")
        grid_s = np.arange(time_s[0] + WINDOW_S, time_s[-1] - WINDOW_S, _STEP_S)
        x, y = (
            _at(Signal(time_s, one), grid_s + 0.5 * WINDOW_S)
            - _at(Signal(time_s, one), grid_s - 0.5 * WINDOW_S)
            for one in xy.T
        )
        after = np.clip(np.searchsorted(time_s, grid_s), 1, len(time_s) - 1)
        held = time_s[after] - time_s[after - 1] < _LONGEST_GAP_S
        self.speed = Signal(grid_s, np.where(held, np.hypot(x, y) / WINDOW_S, np.nan))
        moving = self.speed.values > slowest_mps
        course = np.where(moving, np.arctan2(y, x), np.nan)
        self.course = Signal(grid_s, course)
        half = round(0.5 * WINDOW_S / _STEP_S)
        turned = np.full(len(grid_s), np.nan)
        turned[half:-half] = np.angle(np.exp(1j * (course[2 * half :] - course[: -2 * half])))
        self.course_rate = Signal(grid_s, turned / WINDOW_S)

    def seconds(self, channel: str) -> Array:
        """Return the stamps of a channel in seconds since the first position."""
        return (column(self.found[channel], "stamp_ns") - self._zero_ns) / 1e9

    def measured(self, channel: str, field: str, axis: int | None = None) -> Signal:
        """Return a field of a channel, of a vector the component `axis`."""
        values = column(self.found[channel], field)
        return Signal(self.seconds(channel), values if axis is None else values[:, axis])

    def of_speed(self) -> Proof:
        """Prove the speed by the distance between positions over the time."""
        return proof(_mean(self.measured("speed", "speed_mps")), self.speed)

    def of_yaw_rate(self, channel: str = "imu") -> Proof:
        """Prove the yaw rate of `imu` or `heading` by the change of course."""
        rate = (
            self.measured("imu", "rate_radps", 2)
            if channel == "imu"
            else self.measured("heading", "yaw_rate_radps")
        )
        return proof(_mean(_mean(rate)), self.course_rate)

    def of_heading(self) -> Proof:
        """Prove the heading's change by the course's; see `heading_offset_deg` for its zero."""
        yaw = self.measured("heading", "yaw_rad")
        unwrapped = Signal(yaw.time_s, np.unwrap(yaw.values))
        return proof(_change(_mean(unwrapped)), self.course_rate)

    def heading_offset_deg(self) -> float:
        """Return the median of heading minus course over ground."""
        yaw = self.measured("heading", "yaw_rad")
        told = _at(Signal(yaw.time_s, np.unwrap(yaw.values)), self.course.time_s)
        apart = np.angle(np.exp(1j * (told - self.course.values)))
        return float(np.degrees(np.nanmedian(apart)))

    def of_acceleration(self) -> Proof:
        """Prove the acceleration forwards by the change of measured speed, else of positions'."""
        speed = _mean(self.measured("speed", "speed_mps")) if "speed" in self.found else self.speed
        return proof(_mean(_mean(self.measured("imu", "accel_mps2", 0))), _change(speed))

    def of_steering(self, field: str = "steering_wheel_rad") -> Proof:
        """Prove the steering by the curvature of the course; the slope is in rad for 1/m."""
        curvature = Signal(self.course.time_s, self.course_rate.values / self.speed.values)
        return proof(_mean(_mean(self.measured("steering", field))), curvature)


def column(messages: Iterable[msgspec.Struct], field: str) -> Array:
    """Return one field of messages as an array."""
    return np.array([getattr(message, field) for message in messages])


def proof(measured: Signal, reference: Signal) -> Proof:
    """Compare two quantities at the lag where they correlate best."""
    lags_s = np.arange(-_MOST_LAG_S, _MOST_LAG_S + 1e-9, 0.5 * _STEP_S)
    found = [_compare(_at(measured, reference.time_s + lag), reference.values) for lag in lags_s]
    best = int(np.argmax([abs(one.correlation) for one in found]))
    return found[best]._replace(lag_s=float(lags_s[best]))


def _compare(measured: Array, reference: Array) -> Proof:
    both = np.isfinite(measured) & np.isfinite(reference)
    if both.sum() < 20:
        return Proof(0.0, 0.0, 0.0, both.sum() * _STEP_S)
    a, b = reference[both] - reference[both].mean(), measured[both] - measured[both].mean()
    scale = np.sqrt((a * a).sum() * (b * b).sum())
    correlation = float((a * b).sum() / scale) if scale > 0.0 else 0.0
    return Proof(correlation, float((a * b).sum() / (a * a).sum()), 0.0, both.sum() * _STEP_S)


def _at(signal: Signal, at_s: Array) -> Array:
    """Interpolate; beyond the ends nothing is known."""
    return np.asarray(np.interp(at_s, signal.time_s, signal.values, left=np.nan, right=np.nan))


def _mean(signal: Signal) -> Signal:
    """Return means over windows around the middle of each step."""
    order = np.argsort(signal.time_s, kind="stable")
    time_s, values = signal.time_s[order], signal.values[order]
    area = np.concatenate([[0.0], np.cumsum(np.diff(time_s) * (values[1:] + values[:-1]) / 2)])
    grid_s = np.arange(time_s[0] + WINDOW_S, time_s[-1] - WINDOW_S, _STEP_S)
    whole = Signal(time_s, area)
    high, low = _at(whole, grid_s + 0.5 * WINDOW_S), _at(whole, grid_s - 0.5 * WINDOW_S)
    return Signal(grid_s, (high - low) / WINDOW_S)


def _change(signal: Signal) -> Signal:
    """Return the change per second over windows."""
    later, earlier = (
        _at(signal, signal.time_s + 0.5 * WINDOW_S), _at(signal, signal.time_s - 0.5 * WINDOW_S)
    )  # fmt: skip
    return Signal(signal.time_s, (later - earlier) / WINDOW_S)
