"""What a gyro tells of itself: its white noise, and its bias while the car stands."""

from __future__ import annotations

import math
from typing import NamedTuple

from foretwin.telemetry.estimator.motion_noise import GYRO_BIAS_DENSITY, GYRO_BIAS_STD_RADPS

_MOST_RADPS = 0.005
"""Of an automotive gyro on a rough road; taken until its own samples say less."""
_LEAST_RADPS = 0.001
_SHARE = 0.005
"""Of each sample in the mean square: two seconds at 100 Hz."""
_NEIGHBOURS_NS = 60_000_000
"""Samples further apart hold turning as well as noise between them."""


class _Rate(NamedTuple):
    stamp_ns: int
    rate_radps: float


class Gyro:
    """Watches the yaw rates of a gyro in the order of their stamps.

    The noise is how far a rate lies off the line between its neighbours: turning is smooth over
    hundredths of a second. The bias is what it says while the car stands, tracked by a scalar
    Kalman filter, so that it is known before the heading is.
    """

    def __init__(self) -> None:
        self._last: _Rate | None = None
        self._before: _Rate | None = None
        self._mean_square = _MOST_RADPS**2
        self.bias_radps = 0.0
        self._bias_var = GYRO_BIAS_STD_RADPS**2

    @property
    def std_radps(self) -> float:
        """The standard deviation of one sample's white noise."""
        return min(max(math.sqrt(self._mean_square), _LEAST_RADPS), _MOST_RADPS)

    @property
    def bias_std_radps(self) -> float:
        """How well the bias is known from standing."""
        return math.sqrt(self._bias_var)

    def take(self, stamp_ns: int, rate_radps: float, *, standing: bool) -> None:
        """Take a yaw rate; `standing` where wheels say that the car cannot turn."""
        before, last, now = self._before, self._last, _Rate(stamp_ns, rate_radps)
        self._before, self._last = last, now
        if last is None:
            return
        self._bias_var += GYRO_BIAS_DENSITY * (stamp_ns - last.stamp_ns) * 1e-9
        if standing:
            gain = self._bias_var / (self._bias_var + self.std_radps**2)
            self.bias_radps += gain * (rate_radps - self.bias_radps)
            self._bias_var *= 1.0 - gain
        if before is None or not before.stamp_ns < last.stamp_ns < stamp_ns:
            return
        span_ns = stamp_ns - before.stamp_ns
        if span_ns > _NEIGHBOURS_NS:
            return
        share = (last.stamp_ns - before.stamp_ns) / span_ns
        off = last.rate_radps - (1.0 - share) * before.rate_radps - share * rate_radps
        square = off * off / (1.0 + (1.0 - share) ** 2 + share * share)
        self._mean_square += _SHARE * (square - self._mean_square)
