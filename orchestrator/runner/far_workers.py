"""What is known of workers on other machines: their Worlds, their speed, and their link.

Pure: seconds come in from outside. A far worker is given a task only where it is expected to answer
while a worker of this machine could still take it over, so that no round hangs on a link.
"""

from __future__ import annotations

import statistics
from collections import deque
from dataclasses import dataclass, field

TAKES_OVER = 1.25
"""A near worker that takes a task over is given so many times as long as it usually takes."""
LOOK_S = 0.1
"""So often it is looked whether a task must be taken over, at the least."""
_REMEMBERED, _REMEMBERED_S = 8, 10.0
"""So many answers, and so long, say how fast somebody is now."""


@dataclass(slots=True)
class _Far:
    work_s: float
    """What a task costs it, without the link."""
    link_s: float
    """There and back, of late."""
    worlds: set[str] = field(default_factory=set)
    owes: set[str] = field(default_factory=set)
    """Keys of tasks that were taken from it, and that it has not answered yet."""
    reachable: bool = True
    took: deque[tuple[float, float]] = field(default_factory=lambda: deque(maxlen=_REMEMBERED))
    """When it answered, and after how many seconds."""


@dataclass(slots=True)
class FarWorkers:
    """The workers on other machines; all others are near."""

    taken_over: int = 0
    """Tasks that a far worker was given and a near one took over."""
    _far: dict[str, _Far] = field(default_factory=dict)
    _near_took_s: deque[float] = field(default_factory=lambda: deque(maxlen=_REMEMBERED))

    def __contains__(self, worker_id: str) -> bool:
        return worker_id in self._far

    def __bool__(self) -> bool:
        return bool(self._far)

    def join(self, worker_id: str, *, work_s: float, link_s: float) -> None:
        """A far worker may be given tasks; `work_s` is what its probe cost it."""
        self._far[worker_id] = _Far(work_s, link_s)

    def leave(self, worker_id: str) -> None:
        """A far worker is no more."""
        self._far.pop(worker_id, None)

    def has_world(self, worker_id: str, world_id: str) -> None:
        """A far worker has a World compiled: it may play in it."""
        if worker_id in self._far:
            self._far[worker_id].worlds.add(world_id)

    def took(self, worker_id: str, seconds: float, *, now_s: float) -> None:
        """Take note of how long somebody, near or far, took until an answer was here."""
        far = self._far.get(worker_id)
        (self._near_took_s.append(seconds) if far is None else far.took.append((now_s, seconds)))

    def heard(self, worker_id: str, link_s: float) -> None:
        """A far worker was heard: the link is there; where it was not, what was measured is old."""
        far = self._far.get(worker_id)
        if far is None:
            return
        far.link_s = link_s
        if not far.reachable:
            far.reachable = True
            far.owes.clear()
            far.took.clear()

    def silent(self, worker_id: str) -> None:
        """A far worker left a question without an answer: it gets nothing until it is heard."""
        if worker_id in self._far:
            self._far[worker_id].reachable = False

    def is_silent(self, worker_id: str) -> bool:
        """Whether a far worker has to be heard before it gets anything."""
        return worker_id in self._far and not self._far[worker_id].reachable

    def take_back(self, worker_id: str, key: str) -> None:
        """A task is taken from a far worker, which gets no other before it has answered it."""
        self.taken_over += 1
        self._far[worker_id].owes.add(key)

    def answered(self, worker_id: str, key: str) -> None:
        """A far worker has done with a task."""
        if worker_id in self._far:
            self._far[worker_id].owes.discard(key)

    def expected_s(self, worker_id: str, *, now_s: float) -> float:
        """Return in what time somebody is expected to answer a task; 0 where nothing is known."""
        far = self._far.get(worker_id)
        if far is None:
            return self.near_s if self._far else 0.0
        lately = [took for at_s, took in far.took if now_s - at_s <= _REMEMBERED_S]
        return max(statistics.median(lately) if lately else 0.0, far.work_s + far.link_s)

    @property
    def near_s(self) -> float:
        """What a task takes a near worker, as a rule; 0 before one was answered."""
        return statistics.median(self._near_took_s) if self._near_took_s else 0.0

    def may_take(
        self, worker_id: str, world_id: str, *, due_s: float | None, span_s: float, now_s: float
    ) -> bool:
        """Whether somebody may be given a task that is due `due_s`, `span_s` after its start."""
        far = self._far.get(worker_id)
        if far is None:
            return True
        if far.owes or not far.reachable or world_id not in far.worlds:
            return False
        if due_s is None:
            return True
        answers_s = now_s + self.expected_s(worker_id, now_s=now_s)
        return answers_s <= self.latest_s(due_s=due_s, span_s=span_s)

    def latest_s(self, *, due_s: float, span_s: float) -> float:
        """Return until when a far worker may be waited for: then a near one just makes it.

        Where near ones would need more than half of the time that there is, they are no refuge.
        """
        reserve_s = TAKES_OVER * self.near_s + LOOK_S
        return due_s - (reserve_s if reserve_s <= 0.5 * span_s else 0.0)
