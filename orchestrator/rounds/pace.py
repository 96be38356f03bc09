"""How many futures a round runs, and how often, so that it is complete before the next is due.

A machine that cannot keep up runs fewer futures in a round, the nominal one always among them, and
where even that is not enough fewer rounds, rather than rounds that come too late; with room to
spare it runs more again. Lock step, where no clock runs, always runs all.
"""

from __future__ import annotations

import statistics
from collections import deque
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

SHARES = (0.75, 0.5, 0.25)
"""Of the futures asked for: what rounds may fall to, first to last."""
SPARE = 0.8
"""A round of a pace that fits takes at most so much of its time."""
LATE_ROUNDS, OF_ROUNDS = 2, 4
"""So many late ones among the last rounds, and the next is smaller: one alone may be a World that
a worker has to load."""
CALM_PERIODS, MOST_CALM_PERIODS, LEAST_CALM_ROUNDS = 10, 60, 4
"""So many periods with room to spare, as many more for each fall remembered, and it grows again."""
CALM_SHARE = 0.9
COLD_ROUNDS = 2
"""A drive's first rounds say nothing of the machine: caches are empty, and others still start."""
REMEMBERED_ROUNDS = 240


class Pace(NamedTuple):
    """How many futures a round has, and that of so many rounds that are due, one is run."""

    futures: int
    one_of: int = 1

    @property
    def futures_per_period(self) -> float:
        """What is run in one period of the rounds asked for."""
        return self.futures / self.one_of


class RoundTime(NamedTuple):
    """At which pace a round was run and how long it took, from its start to its last result."""

    pace: Pace
    seconds: float


def paces_between(most: int, least: int) -> tuple[Pace, ...]:
    """Return the paces of rounds of `most` down to `least` futures, the fastest first.

    Where all futures are wanted in every round, the rate is held too.
    """
    if least == most:
        return (Pace(most),)
    sizes = {most, least, *(n for share in SHARES if (n := round(share * most)) > least)}
    return (
        *(Pace(size) for size in sorted(sizes, reverse=True)),
        *(Pace(least, one_of) for one_of in (2, 4)),
    )


def next_pace(history: Sequence[RoundTime], paces: Sequence[Pace], *, period_s: float) -> Pace:
    """Return the pace of the next round: a function of the rounds before it, in order.

    `period_s` lies between rounds asked for. It falls to the fastest of `paces` that would fit if
    a round's cost were in proportion to its futures. Part of the cost is not, so this errs towards
    too much, and a faster pace that is taken up since it would fit does fit: under a steady load,
    paces change one way and come to rest.
    """
    if not history:
        return paces[0]
    pace = history[-1].pace
    rank = paces.index(pace)
    changed = max((i for i, r in enumerate(history) if r.pace != pace), default=-1)
    seconds = [round_.seconds for round_ in history[changed + 1 :]]

    def fits(other: Pace, second: float) -> bool:
        return second * other.futures / pace.futures <= SPARE * period_s * other.one_of

    lately = seconds[-OF_ROUNDS:]
    if sum(s > period_s * pace.one_of for s in lately) >= LATE_ROUNDS and pace != paces[-1]:
        second = statistics.median(lately)
        return next((p for p in paces[rank + 1 :] if fits(p, second)), paces[-1])
    if rank:
        falls = sum(
            after.pace.futures_per_period < before.pace.futures_per_period
            for before, after in pairwise(history)
        )
        periods = min(CALM_PERIODS * (1 + falls), MOST_CALM_PERIODS)
        wanted = max(LEAST_CALM_ROUNDS, periods // pace.one_of)
        calm = sorted(seconds[-wanted:])
        faster = paces[rank - 1]
        if len(calm) == wanted and fits(faster, calm[int(CALM_SHARE * (wanted - 1))]):
            return faster
    return pace


class RoundPace:
    """The pace of one drive's rounds, between `least` and `most` futures; the first are cold."""

    def __init__(
        self, *, most: int, least: int, period_s: float, cold_rounds: int = COLD_ROUNDS
    ) -> None:
        self._paces = paces_between(most, least)
        self._cold_rounds = cold_rounds
        self._period_s = period_s
        self._history: deque[RoundTime] = deque(maxlen=REMEMBERED_ROUNDS)
        self.now = self._paces[0]

    @property
    def slowed(self) -> bool:
        """Whether less is run than was asked for."""
        return self.now != self._paces[0]

    def take(self, pace: Pace, seconds: float) -> bool:
        """Count a round that is complete or given up; returns whether the pace changes."""
        if self._cold_rounds:
            self._cold_rounds -= 1
            return False
        self._history.append(RoundTime(pace, seconds))
        before = self.now
        self.now = next_pace(list(self._history), self._paces, period_s=self._period_s)
        return self.now != before
