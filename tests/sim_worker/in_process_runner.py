"""A runner whose one worker is this process: no bus, no other process, the same code."""

from __future__ import annotations

import time
from collections import OrderedDict

from foretwin.contracts.errors import one_line
from foretwin.contracts.runner import Answer, Task, TaskCount
from foretwin.contracts.setup import WorkerSetup
from foretwin.sim_worker.worker import FuturesWorker


class InProcessRunner:
    """Plays what was submitted, the oldest first, when an answer is taken; see Runner.

    What any worker process would answer: the same code on the same setup.
    """

    def __init__(self, setup: WorkerSetup) -> None:
        self._id = setup.process_id
        self._worker = FuturesWorker(setup)
        self._waiting: OrderedDict[str, Task] = OrderedDict()
        self._count = TaskCount()

    @property
    def capacity(self) -> int:
        """One at a time."""
        return 1

    @property
    def workers(self) -> tuple[str, ...]:
        """Always there."""
        return (self._id,)

    @property
    def count(self) -> TaskCount:
        """What became of the tasks submitted so far; what its only worker cannot do is refused."""
        return self._count

    def close(self) -> None:
        """End what it has started; see FuturesWorker."""
        self._worker.close()

    def submit(self, task: Task) -> None:
        """Take a task; raises ValueError for one whose key is open already."""
        if task.key in self._waiting:
            raise ValueError(f"task {task.key} is submitted twice")
        self._waiting[task.key] = task
        self._count.given += 1

    def cancel(self, key: str) -> None:
        """Forget a task."""
        if self._waiting.pop(key, None) is not None:
            self._count.lost += 1

    def take(self, timeout_s: float | None = 0.0) -> Answer | None:
        """Play the oldest task and return its answer, however long that takes; None without one."""
        if not self._waiting:
            return None
        _, task = self._waiting.popitem(last=False)
        try:
            message = self._worker.answer(task.channel, task.question)
        except Exception as error:  # as over the bus: one bad job never stops the others
            self._count.refused += 1
            return Answer(task, None, one_line(error), self._id, time.monotonic_ns())
        self._count.results += 1
        return Answer(task, message, "", self._id, time.monotonic_ns())
