"""A sweep as events: one parent, the program's own state machine, workers on shared cores."""

from __future__ import annotations

import functools
from collections import OrderedDict
from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

import msgspec

from foretwin.contracts.runner import AHEAD, Task
from foretwin.orchestrator.runner.dispatch import Dispatch
from foretwin.orchestrator.runner.worker_processes import IN_FLIGHT
from tests.scale.engine import Clock, Host, Thread

KEPT_WORLDS = 2
_NO_QUESTION = msgspec.defstruct("NoQuestion", [])()


class JobShape(NamedTuple):
    """What decides how long a job takes: its World and how many futures it has."""

    world: str
    futures: int


class SweepCosts(msgspec.Struct, frozen=True, kw_only=True):
    """CPU seconds of a core whose neighbours are idle."""

    job_s: float
    future_s: float
    first_s: float
    """What the first job in a World costs a worker besides: compiling, and what it then keeps."""
    parent_job_s: float
    parent_future_s: float
    parent_worker_s: float = 0.0
    """What giving out a job costs the parent for each worker that there is."""
    between_s: float
    """Wall time from a worker's answer to its next job where that lies there already."""
    contention: float


class SweepTime(NamedTuple):
    """What a sweep comes to: wall seconds, and CPU seconds of workers and parent."""

    wall_s: float
    jobs_cpu_s: float
    parent_cpu_s: float
    idle_share: float


class _Worker:
    def __init__(self, host: Host, costs: SweepCosts) -> None:
        self._thread, self._costs = Thread(host), costs
        self._worlds: OrderedDict[str, None] = OrderedDict()
        self.work_s = 0.0

    def play(self, shape: JobShape, done: functools.partial[None]) -> None:
        costs = self._costs
        work_s = costs.job_s + costs.future_s * shape.futures
        if shape.world not in self._worlds:
            work_s += costs.first_s
        self._worlds[shape.world] = None
        self._worlds.move_to_end(shape.world)
        while len(self._worlds) > KEPT_WORLDS:
            self._worlds.popitem(last=False)
        self.work_s += work_s
        self._thread.do(work_s, done)


class SweepModel:
    """One sweep; `hosts` workers' hosts, of which the first is the parent's as well where it is
    `local`."""

    def __init__(
        self,
        costs: SweepCosts,
        *,
        workers: int,
        cores: int,
        hosts: int = 1,
        others_cores: float = 0.0,
        ahead: int | None = None,
        local: bool = True,
    ) -> None:
        self._clock, self._costs = Clock(), costs
        # As `contracts.runner.answers` has it: twice what can be at workers, where that is more.
        self._ahead = max(AHEAD, 2 * IN_FLIGHT * workers) if ahead is None else ahead
        made = [
            Host(self._clock, cores, contention=costs.contention, others_cores=others_cores)
            for _ in range(hosts)
        ]
        names = [f"w{n}" for n in range(workers)]
        self._workers = {n: _Worker(made[k % hosts], costs) for k, n in enumerate(names)}
        self._parent = Thread(made[0] if local else Host(self._clock, 1))
        self._dispatch = Dispatch(in_flight=IN_FLIGHT)
        self._dispatch.expect(names)
        for name in names:
            self._dispatch.worker_up(name)
        self._left: Iterator[tuple[int, JobShape]] = iter(())
        self._shapes: dict[str, JobShape] = {}
        self._ended_s = 0.0

    def play(self, jobs: Iterable[JobShape]) -> SweepTime:
        """Play jobs in their order and return what that took."""
        self._left = enumerate(jobs)
        for _ in range(self._ahead):
            self._submit()
        self._give_out()
        self._clock.run()
        at_jobs_s = sum(worker.work_s for worker in self._workers.values())
        whole_s = len(self._workers) * self._ended_s
        return SweepTime(
            wall_s=self._ended_s,
            jobs_cpu_s=at_jobs_s,
            parent_cpu_s=self._parent.work_s,
            idle_share=1.0 - at_jobs_s / whole_s if whole_s else 0.0,
        )

    def _submit(self) -> None:
        for number, shape in self._left:
            key = f"{number}"
            self._shapes[key] = shape
            self._dispatch.submit(Task(key, "job", shape.world, _NO_QUESTION))
            return

    def _give_out(self) -> None:
        for worker_id, task in self._dispatch.assignments(now_s=self._clock.now_s):
            done = functools.partial(self._answered, worker_id, task.key)
            call = functools.partial(self._workers[worker_id].play, self._shapes[task.key], done)
            self._clock.after(self._costs.between_s, call)

    def _answered(self, worker_id: str, key: str) -> None:
        """Let the parent give out more, and only then work on the answer."""
        self._ended_s = self._clock.now_s

        def taken() -> None:
            self._dispatch.answered(worker_id, key)
            self._give_out()

        def worked_on() -> None:
            self._submit()
            self._give_out()

        costs, shape = self._costs, self._shapes.pop(key)
        self._parent.do(costs.parent_worker_s * len(self._workers), taken)
        self._parent.do(costs.parent_job_s + costs.parent_future_s * shape.futures, worked_on)


def in_worlds(jobs: int, *, worlds: int, futures: int) -> Sequence[JobShape]:
    """Return so many jobs of one size, World after World."""
    return [JobShape(f"world-{n * worlds // jobs}", futures) for n in range(jobs)]
