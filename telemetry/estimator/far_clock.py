"""How far another machine's clock is from ours, and how long a question takes there and back.

Cristian's algorithm: the answer was given between question and answer, so that the offset is known
to half the time that both took, and best from the question that took least.
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

_REMEMBERED = 16


class ClockSample(NamedTuple):
    """One question: how long it took, and their clock less ours in the middle of it."""

    link_s: float
    offset_s: float


class FarClock:
    """The last questions to one clock."""

    def __init__(self) -> None:
        self._samples: deque[ClockSample] = deque(maxlen=_REMEMBERED)

    def __len__(self) -> int:
        return len(self._samples)

    def take(self, asked_s: float, answered_s: float, *, ours_ns: int, theirs_ns: int) -> None:
        """Take an answer: seconds are monotonic, `ours_ns` is our UTC when it came."""
        link_s = answered_s - asked_s
        middle_ns = ours_ns - link_s / 2 * 1e9
        self._samples.append(ClockSample(link_s, (theirs_ns - middle_ns) * 1e-9))

    @property
    def best(self) -> ClockSample:
        """The question that took least."""
        return min(self._samples)

    @property
    def last(self) -> ClockSample:
        """The newest."""
        return self._samples[-1]

    def beyond(self, most_s: float) -> bool:
        """Whether the clocks are surely farther apart than `most_s`."""
        return abs(self.best.offset_s) - self.best.link_s / 2 > most_s
