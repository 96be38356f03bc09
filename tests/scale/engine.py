"""A clock of events, hosts whose cores are shared, and threads that do one thing after another."""

from __future__ import annotations

import heapq
import itertools
import math
from collections import deque
from collections.abc import Callable

Call = Callable[[], None]


LEAST_CORES = 0.05
"""However much others take, so much of a machine is left."""


class Clock:
    """Simulated time: what is due is called in order."""

    def __init__(self) -> None:
        self.now_s = 0.0
        self._due: list[tuple[float, int, Call]] = []
        self._number = itertools.count()

    def after(self, delay_s: float, call: Call) -> None:
        """Call something so long from now; what is due at one time, in the order of asking."""
        heapq.heappush(self._due, (self.now_s + delay_s, next(self._number), call))

    def run(self, until_s: float = math.inf) -> None:
        """Let time pass until then, or until nothing is due."""
        while self._due and self._due[0][0] <= until_s:
            self.now_s, _, call = heapq.heappop(self._due)
            call()


class Host:
    """Cores that all who want to run share evenly.

    Each core is slowed to 1 / (1 + `contention`) while all its neighbours are busy, and by as much
    less as fewer of them are: caches, memory and hyper-threads are shared. Somebody else takes so
    many cores (`others_cores`), whatever is done here; how that slows a core is in all works.
    """

    def __init__(
        self, clock: Clock, cores: int, *, contention: float = 0.0, others_cores: float = 0.0
    ) -> None:
        self._clock, self._cores = clock, cores
        self._contention = contention
        self._left_cores = max(cores - others_cores, LEAST_CORES)
        self._done_at: list[tuple[float, int, Call]] = []
        """By how much work each must have had since the beginning to be done."""
        self._work_s, self._looked_s = 0.0, 0.0
        self._number = itertools.count()
        self.busy_core_s = 0.0

    def rate(self, running: int) -> float:
        """Return seconds of work done in a second by each of so many."""
        if not running:
            return 1.0
        busy = min((running - 1.0) / (self._cores - 1), 1.0) if self._cores > 1 else 0.0
        return self._share(running) / (1.0 + self._contention * busy)

    def run(self, work_s: float, done: Call) -> None:
        """Do so much work beside what is being done, then call."""
        self._look()
        heapq.heappush(self._done_at, (self._work_s + work_s, next(self._number), done))
        self._wake()

    def _share(self, running: int) -> float:
        """Return the share of a core that each of so many has."""
        return min(1.0, self._left_cores / running)

    def _look(self) -> None:
        """Bring what was done up to now."""
        running = len(self._done_at)
        passed_s = self._clock.now_s - self._looked_s
        self._looked_s = self._clock.now_s
        if running:
            self._work_s += passed_s * self.rate(running)
            self.busy_core_s += passed_s * running * self._share(running)

    def _wake(self) -> None:
        """Be called when the next one is done, unless others come in between."""
        if not self._done_at:
            return
        asked = self._number_of_wakes = next(self._number)
        left_s = max(self._done_at[0][0] - self._work_s, 0.0)
        self._clock.after(left_s / self.rate(len(self._done_at)), lambda: self._finish(asked))

    def _finish(self, asked: int) -> None:
        if asked != self._number_of_wakes:
            return
        self._look()
        due = []
        while self._done_at and self._done_at[0][0] <= self._work_s + 1e-12:
            due.append(heapq.heappop(self._done_at)[2])
        self._wake()
        for done in due:
            done()


class Thread:
    """Does one thing after another on a host."""

    def __init__(self, host: Host) -> None:
        self._host = host
        self._waiting: deque[tuple[float, Call]] = deque()
        self._at_work = False
        self.work_s = 0.0

    def do(self, work_s: float, done: Call) -> None:
        """Do so much work after all that was asked before, then call."""
        self._waiting.append((work_s, done))
        if not self._at_work:
            self._next()

    def _next(self) -> None:
        if not self._waiting:
            self._at_work = False
            return
        self._at_work = True
        work_s, done = self._waiting.popleft()
        self.work_s += work_s

        def ended() -> None:
            done()
            self._next()

        self._host.run(work_s, ended)
