"""The desk where rounds are cut into jobs, given to idle workers, and put together again.

Pure: no bus, no clock. A job lost with its worker goes to another one; a result counts once.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from typing import NamedTuple

from foretwin.contracts.futures import Future, FuturesResult, Job
from foretwin.contracts.job_identity import JobBytes, job_bytes

MAX_REFUSALS = 3
"""A round whose jobs are refused so often is given up: the same job would be refused for ever."""


class Assignment(NamedTuple):
    """One job for one worker."""

    worker_id: str
    job: Job


@dataclass(frozen=True, slots=True, kw_only=True)
class RoundOrder:
    """A round to run: its jobs, and when the sample that seeds it was received."""

    round_id: int
    stamp_ns: int
    junction_id: str
    world_id: str
    receipt_mono_ns: int
    started_mono_ns: int
    jobs: tuple[Job, ...]
    recorded: tuple[JobBytes, ...] = field(init=False)
    """The jobs as they are recorded."""

    def __post_init__(self) -> None:
        """Put the jobs into bytes: what is known of them is known by their hash."""
        object.__setattr__(self, "recorded", tuple(job_bytes(job) for job in self.jobs))

    @property
    def futures(self) -> tuple[Future, ...]:
        """All futures of the round, in the order of its jobs."""
        return tuple(future for job in self.jobs for future in job.futures)


@dataclass(frozen=True, slots=True, kw_only=True)
class RoundDone:
    """A complete round: results in the order of its jobs, and how long it took.

    `latency_ms` from the receipt of the state to the last result, `seconds` from the round's start.
    """

    order: RoundOrder
    results: tuple[FuturesResult, ...]
    latency_ms: float
    seconds: float


@dataclass(slots=True)
class _Open:
    order: RoundOrder
    waiting: deque[Job]
    results: dict[int, FuturesResult] = field(default_factory=dict)
    refusals: int = 0


@dataclass(slots=True)
class RoundDesk:
    """Holds the open rounds; live there is one at most."""

    late_results: int = 0
    requeued_jobs: int = 0
    given_up_rounds: int = 0
    _open: dict[int, _Open] = field(default_factory=dict)
    _idle: dict[str, None] = field(default_factory=dict)
    _busy: dict[str, Job] = field(default_factory=dict)

    @property
    def workers(self) -> tuple[str, ...]:
        """Ids of the workers that are up."""
        return tuple(sorted({*self._idle, *self._busy}))

    @property
    def busy(self) -> dict[str, Job]:
        """Which worker is at which job."""
        return dict(self._busy)

    @property
    def open_rounds(self) -> tuple[int, ...]:
        """Ids of the rounds that are not complete."""
        return tuple(self._open)

    def worker_up(self, worker_id: str) -> None:
        """A worker is there; a job that an earlier life of it held is given out again."""
        self.worker_down(worker_id)
        self._idle[worker_id] = None

    def worker_down(self, worker_id: str) -> None:
        """A worker is gone; its job goes to the front of its round's queue."""
        self._idle.pop(worker_id, None)
        job = self._busy.pop(worker_id, None)
        if job is not None and job.round_id in self._open:
            self._open[job.round_id].waiting.appendleft(job)
            self.requeued_jobs += 1

    def open(self, order: RoundOrder) -> None:
        """Begin a round."""
        self._open[order.round_id] = _Open(order, deque(order.jobs))

    def drop(self) -> None:
        """Give up every open round; what its workers still send is late."""
        self._open.clear()

    def assignments(self) -> list[Assignment]:
        """Give waiting jobs to idle workers, oldest round first."""
        given = []
        for round_ in self._open.values():
            while round_.waiting and self._idle:
                worker_id = min(self._idle)
                del self._idle[worker_id]
                job = round_.waiting.popleft()
                self._busy[worker_id] = job
                given.append(Assignment(worker_id, job))
        return given

    def result(
        self,
        worker_id: str,
        job: Job,
        result: FuturesResult | None,
        received_mono_ns: int,
        *,
        refused: bool = False,
    ) -> RoundDone | None:
        """Take a worker's answer (None: it failed); returns the round if this completes it.

        A job that failed goes to the next idle worker. `refused` says that a worker tried it and
        could not: after a few of these the round is given up.
        """
        if self._busy.get(worker_id) is job:
            del self._busy[worker_id]
            self._idle[worker_id] = None
        round_ = self._open.get(job.round_id)
        if round_ is None:
            self.late_results += 1
            return None
        if result is None:
            round_.refusals += refused
            if round_.refusals >= MAX_REFUSALS:
                del self._open[job.round_id]
                self.given_up_rounds += 1
            elif not self._holds(round_, job):
                round_.waiting.appendleft(job)
                self.requeued_jobs += 1
            return None
        if job.job_index in round_.results:
            self.late_results += 1
            return None
        round_.results[job.job_index] = result
        round_.waiting = deque(w for w in round_.waiting if w.job_index != job.job_index)
        if len(round_.results) < len(round_.order.jobs):
            return None
        del self._open[job.round_id]
        return RoundDone(
            order=round_.order,
            results=tuple(round_.results[j.job_index] for j in round_.order.jobs),
            latency_ms=(received_mono_ns - round_.order.receipt_mono_ns) / 1e6,
            seconds=(received_mono_ns - round_.order.started_mono_ns) / 1e9,
        )

    def _holds(self, round_: _Open, job: Job) -> bool:
        """Whether the job has a result, waits already, or is with another worker."""
        return (
            job.job_index in round_.results
            or any(waiting is job for waiting in round_.waiting)
            or any(busy is job for busy in self._busy.values())
        )
