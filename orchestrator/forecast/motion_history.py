"""What is remembered of a car's own motion: its speeds of the last seconds, and how far it went."""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.sim_worker.driver_model import STANDING_MPS

KEPT_S = 30.0
"""Speeds farther back say little of the next seconds."""
STEP_NS = 95_000_000
"""Between two speeds that are kept: estimators give up to 50 a second."""
HOLE_NS = 2_000_000_000
"""After so long without a state nobody knows how far the car went."""


class MotionMoment(NamedTuple):
    """A car's motion at one instant; `travelled_m` counts from the first, within one `stretch`."""

    stamp_ns: int
    speed_mps: float
    travelled_m: float
    stretch: int


class MotionHistory:
    """Takes speeds in the order of their stamps; a function of these alone."""

    def __init__(self) -> None:
        self._kept: deque[tuple[int, float]] = deque()
        self._stood_ns: int | None = None
        self.before: MotionMoment | None = None
        """The moment before the newest."""
        self.now: MotionMoment | None = None
        """The newest moment."""

    def take(self, stamp_ns: int, speed_mps: float) -> None:
        """Take a speed; after a hole, or a step back in time, what was before is forgotten."""
        speed, last = abs(speed_mps), self.now
        if last is None or not 0 <= stamp_ns - last.stamp_ns <= HOLE_NS:
            self._kept.clear()
            self._stood_ns = None
            self.before, stretch = None, 0 if last is None else last.stretch + 1
            self.now = MotionMoment(stamp_ns, speed, 0.0, stretch)
        elif stamp_ns > last.stamp_ns:
            way_m = 0.5 * (speed + last.speed_mps) * (stamp_ns - last.stamp_ns) / 1e9
            self.before = last
            self.now = MotionMoment(stamp_ns, speed, last.travelled_m + way_m, last.stretch)
        else:
            return
        if speed < STANDING_MPS:
            self._stood_ns = stamp_ns
        if not self._kept or stamp_ns - self._kept[-1][0] >= STEP_NS:
            self._kept.append((stamp_ns, speed))
        while stamp_ns - self._kept[0][0] > KEPT_S * 1e9:
            self._kept.popleft()

    def travelled_at(self, stamp_ns: int) -> float:
        """Return how far the car had gone at an instant between the last two moments."""
        assert self.now is not None
        if self.before is None or stamp_ns >= self.now.stamp_ns:
            return self.now.travelled_m
        share = (stamp_ns - self.before.stamp_ns) / (self.now.stamp_ns - self.before.stamp_ns)
        return self.before.travelled_m + share * (self.now.travelled_m - self.before.travelled_m)

    def speeds_mps(self, ago_s: Array) -> Array:
        """Return the speeds so long ago; no number where nothing reaches back so far."""
        assert self.now is not None
        stamps = np.array([stamp - self.now.stamp_ns for stamp, _ in self._kept]) / 1e9
        speeds = np.array([speed for _, speed in self._kept])
        return np.asarray(np.interp(-ago_s, stamps, speeds, left=np.nan))

    def recent_mps(self, within_s: float) -> Array:
        """Return the kept speeds of the last seconds."""
        assert self.now is not None
        oldest = self.now.stamp_ns - round(within_s * 1e9)  # whole, as it may be from 1970
        return np.array([speed for stamp, speed in self._kept if stamp >= oldest] or [0.0])

    @property
    def since_standing_s(self) -> float:
        """Since when the car does not stand any more, at most as long as is remembered."""
        if self.now is None or self._stood_ns is None:
            return KEPT_S
        return min((self.now.stamp_ns - self._stood_ns) / 1e9, KEPT_S)
