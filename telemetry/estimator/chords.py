"""Where fixes say that a car goes, in straight pieces, and what other sensors say meanwhile."""

from __future__ import annotations

import bisect
import math
from typing import NamedTuple

from foretwin.contracts.arrays import Array

_LEAST_M, _DEVIATIONS, _LEAST_S, LONGEST_S = 3.0, 15.0, 0.5, 6.0
"""A chord as long as 15 standard deviations of its ends has a course good to a tenth of a radian;
of one that takes longer to drive nobody knows the way between."""
_LEAST_MPS = 1.5
"""The fixes of a car that stands wander more slowly. Chosen."""
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


class ChordBegun(NamedTuple):
    """The fix that the next chord begins with."""

    time_s: float
    xy_m: Array

    def to(self, time_s: float, xy_m: Array, std_m: float) -> Chord | None:
        """Return the chord to a fix at `xy_m` (2,) with white noise of `std_m`, if it is one."""
        x_m, y_m = (xy_m - self.xy_m).tolist()
        length_m, lasts_s = math.hypot(x_m, y_m), time_s - self.time_s
        if length_m < max(_LEAST_M, _DEVIATIONS * std_m, _LEAST_MPS * lasts_s):
            return None
        if not _LEAST_S <= lasts_s <= LONGEST_S:
            return None
        return Chord(self.time_s, time_s, length_m, math.atan2(y_m, x_m))


class Trail(NamedTuple):
    """A sensor's value, or the integral of its rate, at any instant of the last seconds."""

    marks: tuple[tuple[float, float], ...] = ()
    """Time and value, some of all."""
    time_s: float = -math.inf
    rate: float = 0.0
    value: float = 0.0

    def gone_on(self, time_s: float, rate: float) -> Trail:
        """Return the trail gone on by a rate, evenly from the one before."""
        if not self._joins(time_s):
            return Trail(((time_s, self.value),), time_s, rate, self.value)
        value = self.value + 0.5 * (self.rate + rate) * (time_s - self.time_s)
        return Trail(self._marked(time_s, value), time_s, rate, value)

    def turned_to(self, time_s: float, angle_rad: float) -> Trail:
        """Return the trail gone on by an angle, the short way round."""
        value = self.value + math.remainder(angle_rad - self.value, math.tau)
        marks = self._marked(time_s, value) if self._joins(time_s) else ((time_s, value),)
        return Trail(marks, time_s, 0.0, value)

    def _joins(self, time_s: float) -> bool:
        return 0.0 <= time_s - self.time_s <= _GAP_S

    def _marked(self, time_s: float, value: float) -> tuple[tuple[float, float], ...]:
        marks = self.marks
        if time_s - marks[-1][0] < _MARK_S:
            return marks
        kept = marks[1:] if time_s - marks[0][0] > _KEPT_S else marks
        return (*kept, (time_s, value))

    def at(self, time_s: float) -> float | None:
        """Return the value at `time_s`; None where no samples are around it."""
        marks = self.marks
        if not marks or not marks[0][0] <= time_s <= self.time_s + _GAP_S:
            return None
        after = bisect.bisect_right(marks, (time_s, math.inf))
        if after == len(marks):
            return self.value + self.rate * (time_s - self.time_s)
        (from_s, before), (to_s, value) = marks[after - 1], marks[after]
        return before + (value - before) * (time_s - from_s) / (to_s - from_s)
