"""Which worker is given which task: of the rounds of a drive and of the jobs of a sweep alike.

Pure: no bus, no clock. A task lost with its worker or refused by it goes to another one; an answer
counts once, and every task ends in exactly one way.
"""

from __future__ import annotations

from collections import OrderedDict, deque
from collections.abc import Collection, Iterable
from dataclasses import dataclass, field
from typing import NamedTuple

from foretwin.contracts.runner import Task, TaskCount
from foretwin.orchestrator.runner.far_workers import FarWorkers
from foretwin.orchestrator.runner.open_tasks import OpenTask, WorkerAtWork
from foretwin.orchestrator.runner.sickness import Sickness

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
class Dispatch:
    """Holds the tasks that are not ended, and the workers that are up.

    Only workers that are expected are given anything. One is given up to `in_flight` tasks; more
    than one only while so many wait that no other worker lacks work for it. A task that every
    expected worker has refused is given up; until then each of them is asked once.
    """

    in_flight: int = 1
    requeued: int = 0
    late: int = 0
    """Answers to tasks that were answered or cancelled before."""
    count: TaskCount = field(default_factory=TaskCount)
    sickness: Sickness = field(default_factory=Sickness)
    far: FarWorkers = field(default_factory=FarWorkers)
    _expected: frozenset[str] = frozenset()
    _open: dict[str, OpenTask] = field(default_factory=dict)
    _waiting: OrderedDict[str, deque[Task]] = field(default_factory=OrderedDict)
    """By World, none of them empty."""
    _workers: dict[str, WorkerAtWork] = field(default_factory=dict)

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

    @property
    def waiting(self) -> int:
        """How many of them are with no worker; who is `busy` may be at one that has ended."""
        return sum(map(len, self._waiting.values()))

    def submit(
        self, task: Task, *, due_s: float | None = None, span_s: float = 0.0, near: bool = False
    ) -> None:
        """Take a task; raises ValueError for one whose key is open already.

        What is due `due_s`, `span_s` after its start, goes to a far worker only where that is
        expected to answer in time; what is `near` to none.
        """
        if task.key in self._open:
            raise ValueError(f"task {task.key} is submitted twice")
        self.count.given += 1
        self._open[task.key] = OpenTask(task, due_s=due_s, span_s=span_s, near=near)
        self._waiting.setdefault(task.world_id, deque()).append(task)

    def cancel(self, key: str) -> None:
        """Forget a task; a worker that is at it is let finish, and its answer is late."""
        if self._ends(key) is not None:
            self.count.lost += 1

    def close(self) -> None:
        """Forget every task: the run is over."""
        for key in list(self._open):
            self.cancel(key)

    def expect(self, worker_ids: Iterable[str]) -> list[GivenUp]:
        """Give work to these workers alone from now on, once they are up."""
        self._expected = frozenset(worker_ids)
        given_up = []
        for worker_id in sorted(self._workers.keys() - self._expected):
            given_up += self.worker_down(worker_id)
        for key in list(self._open):
            given_up += self._refused_by(self._expected, key)
        return given_up

    def worker_up(self, worker_id: str) -> list[GivenUp]:
        """A worker is there; what an earlier life of it held is given out again."""
        if worker_id not in self._expected:
            return []
        lost = self.worker_down(worker_id)
        self.sickness.well(worker_id)
        self._workers[worker_id] = WorkerAtWork()
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
                given_up += self.give_up(at.key, f"{ATTEMPTS} workers died of it{last}")
        for task in reversed(worker.at_work):
            self._wait_again(task.key)
        return given_up

    def trust(self, worker_id: str) -> None:
        """A worker that left questions without an answer lives: they are given out again."""
        worker = self._workers.get(worker_id)
        for key in () if worker is None else sorted(worker.silent):
            self._leaves(worker_id, key)
            self._wait_again(key)

    def assignments(self, *, now_s: float) -> list[Assignment]:
        """Give waiting tasks to workers: of a worker's World first, then of one no other is at."""
        given = []
        while (one := self._assignment(now_s)) is not None:
            worker = self._workers[one.worker_id]
            self._no_longer_waits(self._open[one.task.key])
            worker.take(one.task, turn=1 + max(each.turn for each in self._workers.values()))
            given.append(one)
        return given

    def take_over(self, *, now_s: float) -> None:
        """Let near workers take over what far ones will not answer in time."""
        for worker_id, worker in self._workers.items():
            if worker_id not in self.far:
                continue
            for task in list(worker.at_work):
                known = self._open.get(task.key)
                if known is None or known.due_s is None:
                    continue
                if now_s >= self.far.latest_s(due_s=known.due_s, span_s=known.span_s):
                    self.take_back(worker_id, task.key)

    def take_back(self, worker_id: str, key: str) -> None:
        """Give a far worker's task to another; should it answer first, its answer counts."""
        self._leaves(worker_id, key)
        self.far.take_back(worker_id, key)
        self._wait_again(key)

    def answered(self, worker_id: str, key: str) -> bool:
        """Take note of an answer; returns whether it counts."""
        self._leaves(worker_id, key)
        self.sickness.well(worker_id)
        if self._ends(key) is None:
            self.late += 1
            return False
        self.count.results += 1
        return True

    def refused(self, worker_id: str, key: str, reason: str, *, now_s: float) -> list[GivenUp]:
        """Take note that a worker tried a task and could not; returns it where nobody else can."""
        self._leaves(worker_id, key)
        known = self._open.get(key)
        if known is None:  # nor does it tell of the worker: a question may have timed out
            self.late += 1
            return []
        self.sickness.refused(worker_id, key, reason, now_s=now_s)
        known.refused_by.add(worker_id)
        known.refusal = reason
        self._wait_again(key)
        return self._refused_by(self._expected, key)

    def without_takers(self, key: str) -> list[GivenUp]:
        """Give a task up that every worker which is up has refused; returns it where that is so."""
        return self._refused_by(self._workers, key)

    @property
    def most_refusals(self) -> int:
        """By how many workers a task that waits has been refused, at most."""
        return max((len(one.refused_by) for one in self._open.values() if one.waits), default=0)

    def unanswered(self, worker_id: str, key: str) -> None:
        """Take note that a question ended without an answer: its worker may be dead.

        Until it is trusted or down, it is given nothing.
        """
        worker = self._workers.get(worker_id)
        if worker is not None and any(task.key == key for task in worker.at_work):
            worker.silent.add(key)

    def give_up(self, key: str, reason: str) -> list[GivenUp]:
        """Try a task no more; returns it where it was open."""
        known = self._ends(key)
        if known is None:
            return []
        self.count.lost += 1
        return [GivenUp(known.task, reason)]

    def _refused_by(self, workers: Collection[str], key: str) -> list[GivenUp]:
        """Give an open task up that all of some workers have refused: it is no fault of theirs."""
        known = self._open.get(key)
        if known is None or not known.refused_by or not known.refused_by.issuperset(workers):
            return []
        self._ends(key)
        self.count.refused += 1
        self.sickness.forgive(known.refused_by, key)
        return [GivenUp(known.task, known.refusal)]

    def _ends(self, key: str) -> OpenTask | None:
        known = self._open.pop(key, None)
        if known is not None:
            self._no_longer_waits(known)
        return known

    def _assignment(self, now_s: float) -> Assignment | None:
        """Return the next task to be given, to the idlest, then fastest worker that may take it; of
        equals to the one whose turn is longest ago: none is cold when all are needed."""
        most = self.in_flight if self.waiting >= len(self._workers) else 1
        may_hold = self.sickness.may_hold(self._workers, most, now_s=now_s)
        free = [
            (len(one.at_work), self.far.expected_s(name, now_s=now_s), one.turn, name)
            for name, one in self._workers.items()
            if not one.silent and len(one.at_work) < may_hold[name]
        ]
        for *_, worker_id in sorted(free):
            if (task := self._next(worker_id, now_s)) is not None:
                return Assignment(worker_id, task)
        return None

    def _next(self, worker_id: str, now_s: float) -> Task | None:
        own = self._workers[worker_id].world_id
        taken = {one.world_id for name, one in self._workers.items() if name != worker_id}
        for world_id in sorted(self._waiting, key=lambda name: (name != own, name in taken)):
            for task in self._waiting[world_id]:
                if self._may_take(worker_id, self._open[task.key], now_s):
                    return task
        return None

    def _may_take(self, worker_id: str, known: OpenTask, now_s: float) -> bool:
        if worker_id in known.refused_by or (known.near and worker_id in self.far):
            return False
        return self.far.may_take(
            worker_id, known.task.world_id, due_s=known.due_s, span_s=known.span_s, now_s=now_s
        )

    def _leaves(self, worker_id: str, key: str) -> None:
        worker = self._workers.get(worker_id)
        if worker is not None:
            worker.at_work = deque(task for task in worker.at_work if task.key != key)
            worker.silent.discard(key)
        self.far.answered(worker_id, key)

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

    def _no_longer_waits(self, known: OpenTask) -> None:
        if not known.waits:
            return
        known.waits = False
        world_id, key = known.task.world_id, known.task.key
        left = deque(task for task in self._waiting[world_id] if task.key != key)
        if left:
            self._waiting[world_id] = left
        else:
            del self._waiting[world_id]
