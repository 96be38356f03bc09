"""What is remembered of a car's own motion: its speeds of the last seconds, and how far it went."""

from __future__ import annotations

from bisect import bisect_right
from collections import deque
from operator import attrgetter
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.sim_worker.driver_model import STANDING_MPS

KEPT_S = 30.0
"""Speeds farther back say little of the next seconds; and a round has long been given up."""
STEP_NS = 95_000_000
"""Between two moments that are kept: estimators give up to 50 a second."""
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
        self._kept: deque[MotionMoment] = deque()
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
        if not self._kept or stamp_ns - self._kept[-1].stamp_ns >= STEP_NS:
            self._kept.append(self.now)
        while stamp_ns - self._kept[0].stamp_ns > KEPT_S * 1e9:
            self._kept.popleft()

    def travelled_at(self, stamp_ns: int) -> float | None:
        """Return how far the car had gone at an instant, between the moments around it.

        None where nothing reaches back so far.
        """
        assert self.now is not None
        if stamp_ns >= self.now.stamp_ns:
            return self.now.travelled_m
        if self.before is None:
            return None
        older = (one for one in self._kept if one.stamp_ns < self.before.stamp_ns)
        moments = [*older, self.before, self.now]
        place = bisect_right(moments, stamp_ns, key=attrgetter("stamp_ns"))
        if place == 0:
            return None
        last, after = moments[place - 1 : place + 1]
        share = (stamp_ns - last.stamp_ns) / (after.stamp_ns - last.stamp_ns)
        return last.travelled_m + share * (after.travelled_m - last.travelled_m)

    def speeds_mps(self, ago_s: Array) -> Array:
        """Return the speeds so long ago; no number where nothing reaches back so far."""
        assert self.now is not None
        stamps = np.array([one.stamp_ns - self.now.stamp_ns for one in self._kept]) / 1e9
        speeds = np.array([one.speed_mps for one in self._kept])
        return np.asarray(np.interp(-ago_s, stamps, speeds, left=np.nan))

    def recent_mps(self, within_s: float) -> Array:
        """Return the kept speeds of the last seconds."""
        assert self.now is not None
        oldest = self.now.stamp_ns - round(within_s * 1e9)  # whole, as it may be from 1970
        recent = [one.speed_mps for one in self._kept if one.stamp_ns >= oldest]
        return np.array(recent or [0.0])

    @property
    def since_standing_s(self) -> float:
        """Since when the car does not stand any more, at most as long as is remembered."""
        if self.now is None or self._stood_ns is None:
            return KEPT_S
        return min((self.now.stamp_ns - self._stood_ns) / 1e9, KEPT_S)
