"""Where fixes say that a car goes, in straight pieces, and what other sensors say meanwhile."""

from __future__ import annotations

import bisect
import math
from collections import deque
from typing import NamedTuple

from foretwin.contracts.arrays import Array
from foretwin.telemetry.estimator.shallow_copy import shallow_copy

_LEAST_M, _DEVIATIONS, _LEAST_S, _LONGEST_S = 3.0, 15.0, 0.5, 6.0
"""A chord as long as 15 standard deviations of its ends has a course good to a tenth of a radian;
of one that takes longer to drive nobody knows the way between."""
_KEPT_S, _MARK_S, _GAP_S = 20.0, 0.1, 1.5
"""Samples further apart than the last leave a gap: what was between is not known."""


class Chord(NamedTuple):
    """The straight line between two fixes, and when they were."""

    from_s: float
    to_s: float
    length_m: float
    course_rad: float

    @property
    def middle_s(self) -> float:
        """When the car went as the chord does, at an even speed in an even bend."""
        return 0.5 * (self.from_s + self.to_s)


class Chords:
    """Takes believed fixes in the order of their stamps."""

    def __init__(self) -> None:
        self._from: tuple[float, Array] | None = None

    def take(self, time_s: float, xy_m: Array, std_m: float) -> Chord | None:
        """Take a fix at `xy_m` (2,) with white noise of `std_m`; return the chord that it ends."""
        if self._from is None or time_s - self._from[0] > _LONGEST_S:
            self._from = time_s, xy_m
            return None
        from_s, from_m = self._from
        x_m, y_m = (xy_m - from_m).tolist()
        length_m = math.hypot(x_m, y_m)
        if length_m < max(_LEAST_M, _DEVIATIONS * std_m) or time_s - from_s < _LEAST_S:
            return None
        self._from = time_s, xy_m
        return Chord(from_s, time_s, length_m, math.atan2(y_m, x_m))


class Trail:
    """A sensor's value, or the integral of its rate, at any instant of the last seconds."""

    def __init__(self) -> None:
        self._marks: deque[tuple[float, float]] = deque()
        self._time_s, self._rate, self._value = -math.inf, 0.0, 0.0

    def copy(self) -> Trail:
        """Return another one that goes on from here by itself."""
        other = shallow_copy(self)
        other._marks = self._marks.copy()
        return other

    def go_on(self, time_s: float, rate: float) -> None:
        """Go on by a rate, evenly from the one before."""
        step_s = time_s - self._time_s
        if 0.0 <= step_s <= _GAP_S:
            self._value += 0.5 * (self._rate + rate) * step_s
        self._put(time_s, rate)

    def turn_to(self, time_s: float, angle_rad: float) -> None:
        """Go on by an angle, the short way round."""
        self._value += math.remainder(angle_rad - self._value, math.tau)
        self._put(time_s, 0.0)

    def _put(self, time_s: float, rate: float) -> None:
        if not 0.0 <= time_s - self._time_s <= _GAP_S:
            self._marks.clear()
        self._time_s, self._rate = time_s, rate
        if not self._marks or time_s - self._marks[-1][0] >= _MARK_S:
            self._marks.append((time_s, self._value))
        while time_s - self._marks[0][0] > _KEPT_S:
            self._marks.popleft()

    def at(self, time_s: float) -> float | None:
        """Return the value at `time_s`; None where no samples are around it."""
        if not self._marks or not self._marks[0][0] <= time_s <= self._time_s + _GAP_S:
            return None
        after = bisect.bisect_right(self._marks, (time_s, math.inf))
        if after == len(self._marks):
            return self._value + self._rate * (time_s - self._time_s)
        (from_s, before), (to_s, value) = self._marks[after - 1], self._marks[after]
        return before + (value - before) * (time_s - from_s) / (to_s - from_s)
