"""How the clock of a vehicle stands to ours: asked, where it answers, else from what it sends."""

from __future__ import annotations

import math
from typing import Literal, NamedTuple

from foretwin.telemetry.estimator.far_clock import FarClock

ONE_WAY_STD_S = 0.05
"""How sure a clock is of which only samples tell: their least delay cannot be told from an offset.
Chosen: that of mobile networks is 20 to 80 ms."""
_SLACK_S = 0.01
"""Beyond what both questions leave open: what clocks drift apart between them."""


ClockSource = Literal["asked", "one way"]


class ClockReading(NamedTuple):
    """Our monotonic clock less the vehicle's stamps, at one instant."""

    offset_ns: int
    std_s: float
    how: ClockSource


class VehicleClock:
    """Questions to one vehicle for its time, and what they say together with its samples.

    Asked, the offset is that of the question that took least, and as sure as an even distribution
    over what that leaves open: a twelfth root of the way there and back. A clock that steps begins
    anew.
    """

    def __init__(self) -> None:
        self._asked = FarClock()

    def answered(self, asked_ns: int, answered_ns: int, stamp_ns: int) -> None:
        """Take an answer: our monotonic clock as it was asked and answered, its stamp between."""
        before = self._asked
        newest = FarClock()
        for clock in (before, newest):
            clock.take(asked_ns * 1e-9, answered_ns * 1e-9, ours_ns=answered_ns, theirs_ns=stamp_ns)
        apart_s = abs(newest.last.offset_s - before.best.offset_s)
        if apart_s > (newest.last.link_s + before.best.link_s) / 2.0 + _SLACK_S:
            self._asked = newest

    def reading(self, one_way_ns: int | None) -> ClockReading | None:
        """Return how it stands; `one_way_ns` is receipt less stamp of the least delayed sample.

        None before anything is known.
        """
        if len(self._asked):
            best = self._asked.best
            offset_ns = -round(best.offset_s * 1e9)
            return ClockReading(offset_ns, best.link_s / math.sqrt(12.0), "asked")
        if one_way_ns is None:
            return None
        return ClockReading(one_way_ns, ONE_WAY_STD_S, "one way")


class ClockApart(NamedTuple):
    """The car's stamps less another vehicle's at one instant, and how sure that is."""

    later_ns: int
    std_s: float
    how: Literal["asked", "one way", "the same"]

    @property
    def text(self) -> str:
        """In words, from the other vehicle's side."""
        ahead = "behind" if self.later_ns > 0 else "ahead of"
        return (
            f"its clock is {abs(self.later_ns) / 1e9:.3f} s {ahead} the car's, "
            f"± {self.std_s * 1e3:.0f} ms ({self.how})"
        )


THE_SAME = ClockApart(0, 0.0, "the same")


def between(own: ClockReading, other: ClockReading) -> ClockApart:
    """Return what is added to another vehicle's stamps for the car's own time."""
    how: ClockSource = "asked" if own.how == other.how == "asked" else "one way"
    std_s = math.hypot(own.std_s, other.std_s)
    return ClockApart(other.offset_ns - own.offset_ns, std_s, how)
