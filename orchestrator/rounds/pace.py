"""How many futures a round runs, and how often, so that it is complete before the next is due.

A machine that cannot keep up runs fewer futures in a round, the nominal one always among them, and
where even that is not enough fewer rounds, rather than rounds that come too late; with room to
spare it runs more again. Lock step, where no clock runs, always runs all.
"""

from __future__ import annotations

import math
import statistics
from collections import deque
from collections.abc import Collection, Sequence
from itertools import pairwise
from typing import NamedTuple

from foretwin.contracts.too_old import LATE_ROUNDS, OF_ROUNDS

SHARES = (0.75, 0.5, 0.25)
"""Of the futures asked for: what rounds may fall to, first to last."""
SPARE = 0.8
"""A round of a pace that fits takes at most so much of its time."""
CALM_PERIODS, MOST_CALM_PERIODS, LEAST_CALM_ROUNDS = 10, 60, 4
"""So many periods with room to spare, as many more for each fall remembered, and it grows again."""
CALM_SHARE = 0.9
MEASURED_ROUNDS = 4
"""So many rounds on either side of a change of pace say what its futures cost."""
REMEMBERED_ROUNDS, REMEMBERED_WORLDS = 240, 64


Played = tuple[str, str]
"""A worker that played jobs of a round, and the World in which it did."""


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

    `period_s` lies between rounds asked for. It falls to the fastest of `paces` that would fit by
    what a future was measured to cost (`future_s`), and rises to the next one that would. Under a
    steady load, paces change one way and come to rest.
    """
    if not history:
        return paces[0]
    pace = history[-1].pace
    rank = paces.index(pace)
    changed = max((i for i, r in enumerate(history) if r.pace != pace), default=-1)
    seconds = [round_.seconds for round_ in history[changed + 1 :]]
    each_s = future_s(history)

    def fits(other: Pace, second: float, *, share: float = SPARE) -> bool:
        most_s = second / pace.futures  # where the first future costs no more than the others
        second += (other.futures - pace.futures) * min(each_s, most_s)
        return second <= share * period_s * other.one_of

    lately = seconds[-OF_ROUNDS:]
    if sum(s > period_s * pace.one_of for s in lately) >= LATE_ROUNDS and pace != paces[-1]:
        second = statistics.median(lately)
        # What is measured needs no room for what is not.
        share = SPARE if math.isinf(each_s) else 1.0
        return next((p for p in paces[rank + 1 :] if fits(p, second, share=share)), paces[-1])
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


def future_s(history: Sequence[RoundTime]) -> float:
    """Return what a future adds to a round, infinite where rounds of one size alone were seen.

    At most: from the slowest of the last rounds of more futures, and the fastest of the first
    rounds of fewer that followed, or the other way round.
    """
    sizes = [round_.pace.futures for round_ in history]
    change = max((i for i in range(1, len(sizes)) if sizes[i] != sizes[i - 1]), default=0)
    if not change:
        return math.inf
    before = history[max(change - MEASURED_ROUNDS, 0) : change]
    after = history[change : change + MEASURED_ROUNDS]
    near = [r for r in before if r.pace.futures == sizes[change - 1]]
    many, few = (near, after) if sizes[change] < sizes[change - 1] else (after, near)
    apart_s = max(r.seconds for r in many) - min(r.seconds for r in few)
    return max(apart_s, 0.0) / (many[0].pace.futures - few[0].pace.futures)


class RoundPace:
    """The pace of one drive's rounds, between `least` and `most` futures."""

    def __init__(self, *, most: int, least: int, period_s: float) -> None:
        self._paces = paces_between(most, least)
        self._met: deque[Played] = deque(maxlen=REMEMBERED_WORLDS)
        self._period_s = period_s
        self._history: deque[RoundTime] = deque(maxlen=REMEMBERED_ROUNDS)
        self.now = self._paces[0]

    @property
    def slowed(self) -> bool:
        """Whether less is run than was asked for."""
        return self.now != self._paces[0]

    @property
    def short_of(self) -> str:
        """What is run of what was asked for; empty where it is all."""
        if not self.slowed:
            return ""
        rarely = "" if self.now.one_of == 1 else f" in 1 of {self.now.one_of} rounds"
        return f"{self.now.futures} of {self._paces[0].futures} futures{rarely}"

    def take(self, pace: Pace, seconds: float, by: Collection[Played] = ()) -> bool:
        """Count a round that is complete or given up; returns whether the pace changes.

        `by` are those who played it. Where one did so in its World for the first time, the round
        says nothing of the machine: what is done once was done in it.
        """
        cold = [one for one in by if one not in self._met]
        self._met.extend(cold)
        if cold:
            return False
        self._history.append(RoundTime(pace, seconds))
        before = self.now
        self.now = next_pace(list(self._history), self._paces, period_s=self._period_s)
        return self.now != before
