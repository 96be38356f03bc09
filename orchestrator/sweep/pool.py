"""Worker processes that take tasks one by one; a task outlives the death of its worker."""

from __future__ import annotations

import multiprocessing
import multiprocessing.connection
import signal
import time
from collections.abc import Callable, Sequence
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess
from typing import Any, NamedTuple

ATTEMPTS = 3
"""A task on which so many workers died is given up."""
_POLL_S = 0.5
_END_S = 10.0
"""What a worker that was told to end may take on a busy machine."""
_START_S = 60.0
"""What a worker may take to start on top: a busy machine's imports are no fault of the task."""
_STARTED = "started"

Answer = Callable[[Any], Any]


class Task(NamedTuple):
    """One piece of work; tasks of the same `place` go to the same worker where that helps."""

    number: int
    place: str
    question: Any


class Lost(NamedTuple):
    """Why a task got no answer."""

    reason: str


class _Worker:
    def __init__(self, start: Callable[[Any], Answer], setup: object) -> None:
        context = multiprocessing.get_context("spawn")
        self.connection, theirs = context.Pipe()
        self.process: SpawnProcess = context.Process(
            target=_serve, args=(theirs, start, setup), daemon=True
        )
        self.process.start()
        theirs.close()
        self.task: Task | None = None
        self.started = False
        self.since_s = 0.0
        self.place = ""

    def give(self, task: Task) -> None:
        self.task, self.since_s, self.place = task, time.monotonic(), task.place
        self.connection.send((task.number, task.question))

    def is_late(self, timeout_s: float) -> bool:
        limit_s = timeout_s if self.started else timeout_s + _START_S
        return time.monotonic() - self.since_s > limit_s

    def end(self) -> None:
        self.connection.close()
        self.process.terminate()

    def join(self) -> None:
        self.process.join(_END_S)
        if self.process.is_alive():
            self.process.kill()
            self.process.join(_END_S)


def _serve(connection: Connection, start: Callable[[Any], Answer], setup: object) -> None:
    """Answer tasks until the other end is gone; Ctrl-C is for the one who started us."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    answer = start(setup)
    try:
        connection.send(_STARTED)
        while True:
            number, question = connection.recv()
            connection.send((number, answer(question)))
    except (EOFError, BrokenPipeError, ConnectionResetError):
        return


class Crew:
    """Up to `workers` processes, each started when there is a task for it.

    `start(setup)`, called once in each, gives what answers a task's question; it must be
    importable there. Use it as a context: at its end, whatever ends it, all processes end.
    """

    def __init__(
        self, workers: int, start: Callable[[Any], Answer], setup: object, *, timeout_s: float
    ) -> None:
        self._most, self._start, self._setup = workers, start, setup
        self._timeout_s = timeout_s
        self._workers: list[_Worker] = []

    def __enter__(self) -> Crew:
        return self

    def __exit__(self, *what: object) -> None:
        for worker in self._workers:
            worker.end()
        for worker in self._workers:
            worker.join()
        self._workers.clear()

    @property
    def pids(self) -> list[int]:
        """Return the processes that are there now."""
        return [worker.process.pid for worker in self._workers if worker.process.pid]

    def run(self, tasks: Sequence[Task], done: Callable[[Task, Any], None]) -> None:
        """Have all tasks answered, and call `done` with each answer as it comes.

        Where `ATTEMPTS` workers died of a task, or one did not answer in time, the answer is a
        `Lost`.
        """
        pending = list(reversed(tasks))
        attempts: dict[int, int] = {}
        while len(self._workers) < min(self._most, len(tasks)):
            self._workers.append(self._worker())
        crew = self._workers
        while pending or any(worker.task for worker in crew):
            for worker in crew:
                if worker.task is None and pending:
                    _give(worker, pending, crew)
            ready = multiprocessing.connection.wait(
                [w.connection for w in crew] + [w.process.sentinel for w in crew], _POLL_S
            )
            for index, worker in enumerate(crew):
                said = _received(worker) if worker.connection in ready else None
                if said == _STARTED:
                    worker.started, worker.since_s = True, time.monotonic()
                elif said is not None:
                    task, worker.task = worker.task, None
                    assert task is not None
                    done(task, said[1])
                elif worker.connection in ready or worker.process.sentinel in ready:
                    crew[index] = self._worker()
                    _mourn(worker, pending, attempts, done)
                elif worker.task is not None and worker.is_late(self._timeout_s):
                    crew[index] = self._worker()
                    worker.end()
                    worker.join()
                    done(worker.task, Lost(f"no answer in {self._timeout_s:g} s"))

    def _worker(self) -> _Worker:
        return _Worker(self._start, self._setup)


def _give(worker: _Worker, pending: list[Task], crew: Sequence[_Worker]) -> None:
    """Hand out a task of the worker's place, else one of a place where nobody is, else the next."""
    others = {other.place for other in crew if other is not worker}
    last = len(pending) - 1
    same = (i for i in range(last, -1, -1) if pending[i].place == worker.place)
    free = (i for i in range(last, -1, -1) if pending[i].place not in others)
    task = pending.pop(next(same, next(free, last)))
    try:
        worker.give(task)
    except OSError:
        worker.task = task  # It died idle: its end is seen next, and the task goes to another.


def _received(worker: _Worker) -> Any:
    """Return `_STARTED` or a number and its answer; None where the worker's end is gone."""
    try:
        return worker.connection.recv()
    except (EOFError, OSError):
        return None


def _mourn(
    worker: _Worker,
    pending: list[Task],
    attempts: dict[int, int],
    done: Callable[[Task, Any], None],
) -> None:
    """Give a dead worker's task to another, or up."""
    worker.join()
    task, code = worker.task, worker.process.exitcode
    if task is None:
        return
    attempts[task.number] = attempts.get(task.number, 0) + 1
    if attempts[task.number] < ATTEMPTS:
        pending.append(task)
        return
    how = f"signal {-code}" if code is not None and code < 0 else f"exit code {code}"
    done(task, Lost(f"{ATTEMPTS} workers died of it, the last by {how}"))
