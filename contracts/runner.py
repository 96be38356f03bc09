"""Who plays jobs: what a runner takes and gives, whether its workers are processes or not."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import msgspec

from foretwin.contracts.codec import decode_content
from foretwin.contracts.futures import FuturesResult, Job
from foretwin.contracts.job_identity import JobBytes
from foretwin.contracts.parts import FinishedPart, JobCells
from foretwin.contracts.placement import PlaceRequest
from foretwin.contracts.world_building import WantedWorld

AHEAD = 256
"""Tasks that a runner holds at once: enough for any machine's workers, and their jobs fit in
memory."""
TRIES = 3
"""A task whose answers were wrong so often is given up."""


class JobRequest(msgspec.Struct, frozen=True, kw_only=True):
    """A job, its name, and in which form it is answered, which changes nothing about the job."""

    job: msgspec.Raw
    """The bytes of `job_bytes`, as they are recorded."""
    sha256: str
    cells: JobCells | None = None
    """With them the job is answered by its finished part."""

    def decoded(self) -> Job:
        """Return the job; raises SchemaMismatch for bytes that are none."""
        return decode_content(self.job, Job, where="job")


class JobAnswer(msgspec.Struct, frozen=True, kw_only=True):
    """The result of a job, or its finished part."""

    result: FuturesResult | None = None
    part: FinishedPart | None = None
    leaving: bool = False
    """Its worker takes no more: it was told to end."""
    cpu_s: float = 0.0
    """Processor seconds that its worker has taken since it can play, with all that it started."""


class Task(NamedTuple):
    """One question for one worker; its answer counts once by `key`, a job's hash.

    Tasks of one World go to the worker that has it compiled, where that helps.
    """

    key: str
    channel: str
    world_id: str
    question: msgspec.Struct


class Answer(NamedTuple):
    """What became of a task: a message, or None and in `failure` why there is none."""

    task: Task
    message: Any
    failure: str = ""
    worker_id: str = ""
    received_mono_ns: int = 0
    garbled: bool = False
    """What came was no message of its kind: `failure` says why, and another may be asked."""


@dataclass(slots=True)
class TaskCount:
    """What became of the tasks taken: `given` is what ended in one of three ways, and the open."""

    given: int = 0
    results: int = 0
    refused: int = 0
    """Ended since every worker refused them."""
    lost: int = 0
    """Ended in no answer: their workers died, they came too late, or were wanted no more."""


class Runner(Protocol):
    """Answers every task that is submitted and not cancelled exactly once, in any order."""

    @property
    def capacity(self) -> int:
        """How many tasks can be in work at once; further ones wait."""

    @property
    def workers(self) -> tuple[str, ...]:
        """Ids of the workers that can take work now."""

    @property
    def count(self) -> TaskCount:
        """What became of the tasks submitted so far."""

    def submit(self, task: Task) -> None:
        """Take a task; never waits."""

    def cancel(self, key: str) -> None:
        """Forget a task: it is not begun any more, and an answer to it does not count."""

    def take(self, timeout_s: float | None = 0.0) -> Answer | None:
        """Return one answer, or None where there is none in time (None waits for ever)."""


def job_task(job: Job, named: JobBytes, *, cells: JobCells | None = None) -> Task:
    """Return the task of playing a job: for its result, or as a sweep's finished part."""
    request = JobRequest(job=msgspec.Raw(named.data), sha256=named.sha256, cells=cells)
    return Task(named.sha256, "job", job.world_id, request)


def place_task(request: PlaceRequest) -> Task:
    """Return the task of finding places in a World."""
    return Task(f"places in {request.world_id}", "place", request.world_id, request)


def world_task(request: WantedWorld) -> Task:
    """Return the task of building the World of a junction."""
    return Task(f"World of {request.junction_id}", "build_world", request.junction_id, request)


def _garbled(answer: Answer) -> str:
    return answer.failure if answer.garbled else ""


def answers(
    runner: Runner,
    tasks: Iterable[Task],
    *,
    ahead: int | None = None,
    fault_in: Callable[[Answer], str] = _garbled,
) -> Iterator[Answer]:
    """Have tasks answered by a runner that has no others, and yield the answers as they come.

    Tasks are taken as they are needed: the runner holds at most `ahead`; without, `AHEAD`,
    or where that are more, twice as many as can be in work. An answer, garbled or not, in which
    `fault_in` finds a fault does not count: its task is asked again, up to `TRIES` times in all.
    """
    left, held = iter(tasks), 0
    wrong: Counter[str] = Counter()
    while True:
        most = max(AHEAD, 2 * runner.capacity) if ahead is None else ahead
        for task in itertools.islice(left, max(most - held, 0)):
            runner.submit(task)
            held += 1
        if not held:
            return
        answer = runner.take(None)
        assert answer is not None
        readable = answer.message is not None or answer.garbled
        if readable and (fault := fault_in(answer)):
            wrong[answer.task.key] += 1
            if wrong[answer.task.key] < TRIES:
                runner.submit(answer.task)
                continue
            answer = Answer(answer.task, None, fault, answer.worker_id)
        wrong.pop(answer.task.key, None)
        held -= 1
        yield answer
