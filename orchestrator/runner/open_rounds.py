"""Rounds that are open: cut into tasks, and put together again from what becomes of these."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from foretwin.contracts.futures import Future, FuturesResult, Job
from foretwin.contracts.job_identity import JobBytes, job_bytes
from foretwin.contracts.runner import Answer, Task, job_task
from foretwin.contracts.trace import traced


@dataclass(frozen=True, slots=True, kw_only=True)
class RoundOrder:
    """A round to run: its jobs, and when the sample that seeds it was received.

    What is complete after `deadline_mono_ns` is late; in lock step nothing is.
    """

    round_id: int
    stamp_ns: int
    junction_id: str
    world_id: str
    receipt_mono_ns: int
    started_mono_ns: int
    jobs: tuple[Job, ...]
    deadline_mono_ns: int | None = None
    recorded: tuple[JobBytes, ...] = field(init=False)
    """The jobs as they are recorded."""

    @traced("jobs to bytes")
    def __post_init__(self) -> None:
        """Put the jobs into bytes: what is known of them is known by their hash."""
        object.__setattr__(self, "recorded", tuple(job_bytes(job) for job in self.jobs))

    @property
    def futures(self) -> tuple[Future, ...]:
        """All futures of the round, in the order of its jobs."""
        return tuple(future for job in self.jobs for future in job.futures)

    @property
    def due_s(self) -> float | None:
        """When it is late, on the monotonic clock."""
        return None if self.deadline_mono_ns is None else self.deadline_mono_ns / 1e9

    @property
    def age_s(self) -> float:
        """How long ago it was started."""
        return (time.monotonic_ns() - self.started_mono_ns) * 1e-9

    @property
    def tasks(self) -> tuple[Task, ...]:
        """The tasks of playing the jobs, in their order."""
        return tuple(
            job_task(job, named) for job, named in zip(self.jobs, self.recorded, strict=True)
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class RoundDone:
    """A complete round: results in the order of its jobs, and how long it took.

    `latency_ms` from the receipt of the state to the last result, `seconds` from the round's start.
    A `late` one took longer than its period: it is recorded, and never shown as current.
    """

    order: RoundOrder
    results: tuple[FuturesResult, ...]
    latency_ms: float
    seconds: float
    late: bool = False

    @property
    def played_by(self) -> tuple[tuple[str, str], ...]:
        """The workers that played it, each with the World in which it did."""
        return tuple((result.worker_id, result.world_id) for result in self.results)


class RoundGivenUp(NamedTuple):
    """A round one of whose jobs is given up."""

    order: RoundOrder


@dataclass(slots=True)
class OpenRounds:
    """Holds the open rounds; live there is one at most."""

    _orders: dict[int, RoundOrder] = field(default_factory=dict)
    _results: dict[int, dict[str, FuturesResult]] = field(default_factory=dict)

    def __bool__(self) -> bool:
        return bool(self._orders)

    @property
    def orders(self) -> tuple[RoundOrder, ...]:
        """The rounds that are open, the oldest first."""
        return tuple(self._orders.values())

    def open(self, order: RoundOrder) -> None:
        """Begin a round."""
        self._orders[order.round_id] = order
        self._results[order.round_id] = {}

    def drop(self) -> tuple[RoundOrder, ...]:
        """Give up every open round and return them; what their workers still send is late."""
        dropped = self.orders
        self._orders.clear()
        self._results.clear()
        return dropped

    def take(self, answer: Answer) -> RoundDone | RoundGivenUp | None:
        """Take what became of a task; returns the round where this completes or ends it."""
        key = answer.task.key
        order = next(
            (o for o in self._orders.values() if key in {r.sha256 for r in o.recorded}), None
        )
        if order is None:
            return None
        if answer.message is None:
            self._close(order)
            return RoundGivenUp(order)
        results = self._results[order.round_id]
        results[key] = answer.message.result
        if len(results) < len(order.jobs):
            return None
        self._close(order)
        deadline_ns = order.deadline_mono_ns
        return RoundDone(
            order=order,
            results=tuple(results[named.sha256] for named in order.recorded),
            latency_ms=(answer.received_mono_ns - order.receipt_mono_ns) / 1e6,
            seconds=(answer.received_mono_ns - order.started_mono_ns) / 1e9,
            late=deadline_ns is not None and answer.received_mono_ns > deadline_ns,
        )

    def misfit(self, key: str, result: FuturesResult | None) -> str:
        """Return why an answer is not that of its job; empty where it is, or nobody waits for it.

        A worker that is sick or somebody else must not end a drive.
        """
        for order in self._orders.values():
            for job, named in zip(order.jobs, order.recorded, strict=True):
                if named.sha256 == key:
                    return misfit_of(job, result)
        return "" if result is not None else "rows where trajectories were asked for"

    def _close(self, order: RoundOrder) -> None:
        del self._orders[order.round_id], self._results[order.round_id]


def misfit_of(job: Job, result: FuturesResult | None) -> str:
    """Return why a result is not that of a job, in words; empty where it is."""
    if result is None:
        return "rows where trajectories were asked for"
    played = result.future_indices + tuple(index for index, _ in result.unplaced)
    if sorted(played) != sorted(future.index for future in job.futures):
        return "futures that were not asked for"
    if result.world_id != job.world_id:
        return f"World {result.world_id} instead of {job.world_id}"
    time_s, until_s = result.trajectory.time_s, job.horizon_s
    expected_s = np.arange(len(time_s)) * job.step_s
    if not (len(time_s) and np.allclose(time_s, expected_s, atol=1e-6)):
        return "instants that were not asked for"
    if abs(time_s[-1] - until_s) > job.step_s:
        return f"{time_s[-1]:g} s instead of {until_s:g} s"
    if result.trajectory.stamp_ns != job.state.stamp_ns:
        return "seeded by another state"
    return ""
