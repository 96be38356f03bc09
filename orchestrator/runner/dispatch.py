"""Which worker is given which task: of the rounds of a drive and of the jobs of a sweep alike.

Pure: no bus, no clock. A task lost with its worker goes to another one; an answer counts once.
"""

from __future__ import annotations

from collections import OrderedDict, deque
from dataclasses import dataclass, field
from typing import NamedTuple

from foretwin.contracts.runner import Task

ATTEMPTS = 3
"""A task of which so many workers died is given up."""


class Assignment(NamedTuple):
    """One task for one worker."""

    worker_id: str
    task: Task


class GivenUp(NamedTuple):
    """A task that is not tried again, and why."""

    task: Task
    reason: str


@dataclass(slots=True)
class _Worker:
    at_work: deque[Task] = field(default_factory=deque)
    """In the order in which it answers: it is at the first one."""
    world_id: str = ""
    silent: set[str] = field(default_factory=set)
    """Keys of those tasks at work whose questions ended without an answer."""


@dataclass(slots=True)
class _Open:
    task: Task
    waits: bool = True
    deaths: int = 0
    refusals: int = 0


@dataclass(slots=True)
class Dispatch:
    """Holds the tasks that are not answered, and the workers that are up.

    A worker is given up to `in_flight` tasks; more than one only while so many wait that no other
    worker lacks work for it. A task that was refused `refusals` times is given up.
    """

    in_flight: int = 1
    refusals: int = 1
    requeued: int = 0
    late: int = 0
    """Answers to tasks that were answered or cancelled before."""
    _open: dict[str, _Open] = field(default_factory=dict)
    _waiting: OrderedDict[str, deque[Task]] = field(default_factory=OrderedDict)
    """By World, none of them empty."""
    _workers: dict[str, _Worker] = field(default_factory=dict)

    @property
    def workers(self) -> tuple[str, ...]:
        """Ids of the workers that are up."""
        return tuple(sorted(self._workers))

    @property
    def busy(self) -> dict[str, Task]:
        """Which worker is at which task."""
        return {name: one.at_work[0] for name, one in self._workers.items() if one.at_work}

    @property
    def open(self) -> int:
        """How many tasks are neither answered nor given up."""
        return len(self._open)

    def submit(self, task: Task) -> None:
        """Take a task; raises ValueError for one whose key is open already."""
        if task.key in self._open:
            raise ValueError(f"task {task.key} is submitted twice")
        self._open[task.key] = _Open(task)
        self._waiting.setdefault(task.world_id, deque()).append(task)

    def cancel(self, key: str) -> None:
        """Forget a task; a worker that is at it is let finish, and its answer is late."""
        if (known := self._open.pop(key, None)) is not None:
            self._no_longer_waits(known)

    def worker_up(self, worker_id: str) -> list[GivenUp]:
        """A worker is there; what an earlier life of it held is given out again."""
        lost = self.worker_down(worker_id)
        self._workers[worker_id] = _Worker()
        return lost

    def worker_down(self, worker_id: str, *, how: str = "") -> list[GivenUp]:
        """A worker is gone, `how` in words; what it was at has cost a life."""
        worker = self._workers.pop(worker_id, None)
        if worker is None:
            return []
        given_up = []
        at = next(iter(worker.at_work), None)
        if at is not None and (known := self._open.get(at.key)) is not None:
            known.deaths += 1
            if known.deaths >= ATTEMPTS and not self._at_work(at.key):
                last = f", the last by {how}" if how else ""
                given_up.append(GivenUp(at, f"{ATTEMPTS} workers died of it{last}"))
                self.cancel(at.key)
        for task in reversed(worker.at_work):
            self._wait_again(task.key)
        return given_up

    def trust(self, worker_id: str) -> None:
        """A worker that left questions without an answer lives: they are given out again."""
        worker = self._workers.get(worker_id)
        for key in () if worker is None else sorted(worker.silent):
            self._leaves(worker_id, key)
            self._wait_again(key)

    def assignments(self) -> list[Assignment]:
        """Give waiting tasks to workers: of a worker's World first, then of one no other is at."""
        given = []
        while (worker_id := self._free()) is not None:
            worker = self._workers[worker_id]
            task = self._next(worker)
            worker.at_work.append(task)
            worker.world_id = task.world_id
            given.append(Assignment(worker_id, task))
        return given

    def answered(self, worker_id: str, key: str) -> bool:
        """Take note of an answer; returns whether it counts."""
        self._leaves(worker_id, key)
        known = self._open.pop(key, None)
        if known is None:
            self.late += 1
            return False
        self._no_longer_waits(known)
        return True

    def refused(self, worker_id: str, key: str, reason: str) -> list[GivenUp]:
        """Take note that a worker tried a task and could not; returns it where it is given up."""
        self._leaves(worker_id, key)
        known = self._open.get(key)
        if known is None:
            self.late += 1
            return []
        known.refusals += 1
        if known.refusals >= self.refusals:
            return self.give_up(key, reason)
        self._wait_again(key)
        return []

    def unanswered(self, worker_id: str, key: str) -> None:
        """Take note that a question ended without an answer: its worker may be dead.

        Until it is trusted or down, it is given nothing.
        """
        worker = self._workers.get(worker_id)
        if worker is not None and any(task.key == key for task in worker.at_work):
            worker.silent.add(key)

    def give_up(self, key: str, reason: str) -> list[GivenUp]:
        """Try a task no more; returns it where it was open."""
        known = self._open.get(key)
        self.cancel(key)
        return [] if known is None else [GivenUp(known.task, reason)]

    def _free(self) -> str | None:
        """Return the worker to be given the next task, the idlest first."""
        waiting = sum(map(len, self._waiting.values()))
        most = self.in_flight if waiting >= len(self._workers) else 1
        free = [
            (len(worker.at_work), worker_id)
            for worker_id, worker in self._workers.items()
            if not worker.silent and len(worker.at_work) < most
        ]
        return min(free)[1] if free and waiting else None

    def _next(self, worker: _Worker) -> Task:
        taken = {other.world_id for other in self._workers.values() if other is not worker}
        world_id = worker.world_id
        if world_id not in self._waiting:
            first = next(iter(self._waiting))
            world_id = next((name for name in self._waiting if name not in taken), first)
        task = self._waiting[world_id].popleft()
        self._open[task.key].waits = False
        if not self._waiting[world_id]:
            del self._waiting[world_id]
        return task

    def _leaves(self, worker_id: str, key: str) -> None:
        worker = self._workers.get(worker_id)
        if worker is not None:
            worker.at_work = deque(task for task in worker.at_work if task.key != key)
            worker.silent.discard(key)

    def _at_work(self, key: str) -> bool:
        return any(task.key == key for one in self._workers.values() for task in one.at_work)

    def _wait_again(self, key: str) -> None:
        """Let an open task be the next one, unless it waits already or is with a worker."""
        known = self._open.get(key)
        if known is None or known.waits or self._at_work(key):
            return
        known.waits = True
        world_id = known.task.world_id
        self._waiting.setdefault(world_id, deque()).appendleft(known.task)
        self._waiting.move_to_end(world_id, last=False)
        self.requeued += 1

    def _no_longer_waits(self, known: _Open) -> None:
        if not known.waits:
            return
        world_id, key = known.task.world_id, known.task.key
        left = deque(task for task in self._waiting.pop(world_id) if task.key != key)
        if left:
            self._waiting[world_id] = left
