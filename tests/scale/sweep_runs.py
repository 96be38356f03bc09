"""One sweep after another with so many workers in jobs of such a size: what each process took."""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import msgspec

from foretwin.contracts import trace
from foretwin.contracts.cpu_use import cpu_uses
from foretwin.contracts.runner import Answer, Task, TaskCount
from foretwin.orchestrator.commands.sweep import run_sweep
from foretwin.orchestrator.runner.worker_processes import WorkerProcesses
from tests.scale.workload import Workload
from tests.starvation import children

PARTS = (
    "decode a job", "compile a World", "rehearse", "cast", "step", "collisions", "metrics",
    "accidents", "rows", "encode an answer",
)  # fmt: skip
_TICKS_PER_S = os.sysconf("SC_CLK_TCK")


class PlayedJob(msgspec.Struct, frozen=True, array_like=True):
    """One job as its worker's trace tells it; seconds, from the first job's begin."""

    worker: str
    world: str
    futures: int
    compiled: bool
    """Whether the worker had to compile its World."""
    began_s: float
    ended_s: float
    cpu_s: float
    ready_s: float
    """For how long it would have run and had no processor."""


class SweepRun(msgspec.Struct, frozen=True, kw_only=True):
    """One sweep, whose Worlds and places were known, from its start to its summary."""

    workers: int
    futures_per_job: int
    vehicles: int
    futures: int
    jobs: tuple[PlayedJob, ...]
    parts_s: dict[str, float]
    """CPU time of a job by span, on average; `other` is what no span names."""
    wall_s: float
    """From the first job given to the last answer written."""
    parent_cpu_s: float
    """Of the sweep's own process in that time: plan, bus, router, answers, rows, files."""
    summary_cpu_s: float
    """Of the same before and after: reading, planning and summing up."""
    starting_cpu_s: float
    """Of a worker until it can take work, on average."""
    answer_bytes: float
    """On average of a job."""
    others_cores: float
    """What everybody else took of the machine from the first answer to the last: before it, workers
    start."""

    @property
    def jobs_cpu_s(self) -> float:
        """Return the CPU time of all jobs."""
        return sum(job.cpu_s for job in self.jobs)

    @property
    def makespan_s(self) -> float:
        """Return the wall time from the first job's begin to the last one's end."""
        return max(job.ended_s for job in self.jobs)

    @property
    def unhindered_s(self) -> float:
        """Return that time less what jobs were kept from a processor: by the worker that took
        longest.

        Before its first job a worker starts; how long it was kept from a processor then is not
        known, and taken to be the share that its jobs were.
        """
        share = self.share_of_core
        return max(
            sum(worker.busy_s) + share * worker.gaps_s[0] + sum(worker.gaps_s[1:])
            for worker in self.by_worker().values()
        )

    @property
    def share_of_core(self) -> float:
        """Return which share of the time that jobs wanted a processor they had one."""
        return self.jobs_cpu_s / sum(job.cpu_s + job.ready_s for job in self.jobs)

    def by_worker(self) -> dict[str, WorkerTime]:
        """Return what each worker did with its time."""
        found: dict[str, WorkerTime] = {}
        for name in sorted({job.worker for job in self.jobs}):
            own = sorted((j for j in self.jobs if j.worker == name), key=lambda job: job.began_s)
            before = (0.0, *(job.ended_s for job in own))
            gaps = tuple(job.began_s - ended for job, ended in zip(own, before, strict=False))
            busy = tuple(job.ended_s - job.began_s - job.ready_s for job in own)
            found[name] = WorkerTime(busy, gaps)
        return found

    @property
    def idle_share(self) -> float:
        """Return the share of the workers' time, up to the last job's end, in which they had no
        job: before their first, between two, and after their last."""
        at_jobs_s = sum(job.ended_s - job.began_s for job in self.jobs)
        return 1.0 - at_jobs_s / (self.workers * self.makespan_s)


class WorkerTime(NamedTuple):
    """Seconds of each job less those without a processor, and before each job without one."""

    busy_s: tuple[float, ...]
    gaps_s: tuple[float, ...]


class Taken(NamedTuple):
    """A time, and the CPU seconds that were taken until then: by this process, by it with all that
    it has started and that lives, and by the whole machine."""

    at_s: float
    parent_s: float
    own_s: float
    machine_s: float


def taken_so_far(workers: Sequence[int]) -> Taken:
    """Return what is taken now, by this process and by workers whose ids are given."""
    parent_s = time.process_time()
    own_s = parent_s + sum(_cpu_s(pid) for pid in workers)
    return Taken(time.perf_counter(), parent_s, own_s, _machine_cpu_s())


class _Noting:
    """A runner that notes when it is given its first job, and what the answers weigh."""

    def __init__(self, runner: WorkerProcesses) -> None:
        self._runner = runner
        self.began: Taken | None = None
        self.answers: list[Taken] = []
        self._workers: list[int] = []

    @property
    def capacity(self) -> int:
        return self._runner.capacity

    @property
    def workers(self) -> tuple[str, ...]:
        return self._runner.workers

    @property
    def count(self) -> TaskCount:
        return self._runner.count

    def submit(self, task: Task) -> None:
        if self.began is None:
            self.began = taken_so_far(())
        self._runner.submit(task)

    def cancel(self, key: str) -> None:
        self._runner.cancel(key)

    def take(self, timeout_s: float | None = 0.0) -> Answer | None:
        answer = self._runner.take(timeout_s)
        if answer is not None:
            # To look for them among all processes takes milliseconds, as much as the answer does.
            self._workers = self._workers or list(children(os.getpid()))
            self.answers.append(taken_so_far(self._workers))
        return answer


def play(workload: Workload, name: str, *, workers: int) -> SweepRun:
    """Play a sweep by the program's own way and return what it took."""
    out = workload.unplayed(name)
    traces, files = out.with_name(f"{name}-traces"), out.with_name(f"{name}-files")
    setup = msgspec.structs.replace(workload.setup(out), trace_dir=str(traces))
    traces.mkdir()
    began_cpu_s = time.process_time()
    with (
        _traced(traces),
        WorkerProcesses(workers, setup, task_timeout_s=600.0, folder=files) as runner,
    ):
        noting = _Noting(runner)
        run_sweep(workload.loaded, out, noting)
    began, first, last = noting.began, noting.answers[0], noting.answers[-1]
    assert began is not None
    uses = cpu_uses(files)
    jobs, parts, answers = _read(traces, workload)
    playing_cpu_s = last.parent_s - began.parent_s
    others_s = (last.machine_s - first.machine_s) - (last.own_s - first.own_s)
    run = SweepRun(
        workers=workers,
        futures_per_job=workload.futures_per_job,
        vehicles=workload.vehicles,
        futures=workload.futures,
        jobs=jobs,
        parts_s=parts,
        wall_s=last.at_s - began.at_s,
        parent_cpu_s=playing_cpu_s,
        summary_cpu_s=time.process_time() - began_cpu_s - playing_cpu_s,
        starting_cpu_s=sum(one.starting_cpu_s for one in uses.values()) / max(len(uses), 1),
        answer_bytes=sum(answers) / max(len(answers), 1),
        others_cores=max(others_s, 0.0) / (last.at_s - first.at_s),
    )
    for folder in (out, traces, files):
        shutil.rmtree(folder, ignore_errors=True)
    return run


@contextlib.contextmanager
def _traced(folder: Path) -> Iterator[None]:
    trace.begin(folder, "parent")
    try:
        yield
    finally:
        trace.end()


def _cpu_s(pid: int) -> float:
    """Return the CPU time of a process, 0 of one that is gone."""
    try:
        words = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rsplit(")", 1)[1].split()
    except OSError:
        return 0.0
    return (int(words[11]) + int(words[12])) / _TICKS_PER_S


def _machine_cpu_s() -> float:
    ticks = [int(n) for n in Path("/proc/stat").read_text().split("\n", 1)[0].split()[1:9]]
    return (sum(ticks) - ticks[3] - ticks[4]) / _TICKS_PER_S


def _read(
    traces: Path, workload: Workload
) -> tuple[tuple[PlayedJob, ...], dict[str, float], list[float]]:
    """Return the jobs of all workers, what their parts take, and the bytes of each answer."""
    jobs, answers, parts_s = [], [], dict.fromkeys((*PARTS, "other"), 0.0)
    for file in sorted(traces.glob("*.trace")):
        worker = file.stem.rsplit("-", 1)[0]
        events = [json.loads(line) for line in file.read_bytes().splitlines()]
        spans = [event for event in events if event["ph"] == "X"]
        named = {e["ts"]: e["id"].removeprefix("job ") for e in events if e["ph"] == "f"}
        answers += [e["args"]["bytes"] for e in spans if e["name"] == "decode an answer"]
        for one in (one for one in spans if one["name"] == "job"):
            until_us = one["ts"] + one["dur"]
            inside = [e for e in spans if one["ts"] <= e["ts"] <= until_us and e is not one]
            (key,) = (name for ts, name in named.items() if one["ts"] <= ts <= until_us)
            for part in inside:
                if part["name"] in PARTS:
                    parts_s[part["name"]] += part["tdur"] / 1e6
                    parts_s["other"] -= part["tdur"] / 1e6
            parts_s["other"] += one["tdur"] / 1e6
            world, futures = workload.shapes[key]
            jobs.append(
                PlayedJob(
                    worker=worker,
                    world=world,
                    futures=futures,
                    compiled=any(part["name"] == "compile a World" for part in inside),
                    began_s=one["ts"] / 1e6,
                    ended_s=until_us / 1e6,
                    cpu_s=round(one["tdur"] / 1e6, 6),
                    ready_s=round(one["args"].get(trace.READY_MS, 0.0) / 1e3, 6),
                )
            )
    first_s = min(job.began_s for job in jobs)
    jobs = [
        msgspec.structs.replace(
            job,
            began_s=round(job.began_s - first_s, 6),
            ended_s=round(job.ended_s - first_s, 6),
        )
        for job in sorted(jobs, key=lambda job: job.began_s)
    ]
    return tuple(jobs), {k: round(v / len(jobs), 6) for k, v in parts_s.items()}, answers
