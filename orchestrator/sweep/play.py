"""Plays the jobs of a sweep that are left, whoever plays them, and keeps the parts of them."""

from __future__ import annotations

import itertools
import logging
from collections.abc import Iterator

from foretwin.contracts.job_identity import JobBytes, job_bytes
from foretwin.contracts.runner import Answer, JobRequest, Runner, Task, answers, job_task
from foretwin.orchestrator.progress import Progress
from foretwin.orchestrator.sweep.jobs import JobMaker, cells_of
from foretwin.orchestrator.sweep.plan import SweepPlan
from foretwin.orchestrator.sweep.rows import Due, Parts, fault_in
from foretwin.orchestrator.sweep.shard import Shard
from foretwin.sim_worker.futures.finished_part import finished_part

log = logging.getLogger("orchestrator")


def jobs_left(plan: SweepPlan, maker: JobMaker, parts: Parts, shard: Shard) -> bytearray:
    """Return for each job whether it is left to be played by a shard, 1 or 0."""
    numbers, left = shard.numbers(plan.jobs), bytearray(plan.jobs)
    left[numbers.start : numbers.stop] = b"\1" * len(numbers)
    for one in plan.planned(lambda number: number in numbers and parts.lists(number)):
        left[one.number] = not parts.hold(one.number, job_bytes(maker.job(one)).sha256)
    return left


def play(
    plan: SweepPlan,
    left: bytearray,
    maker: JobMaker,
    parts: Parts,
    runner: Runner,
    progress: Progress,
) -> None:
    """Play jobs, and keep the parts that come back of them; raises OSError."""
    at_work: dict[str, Due] = {}
    told: set[str] = set()
    """Workers of whose rubbish was told."""

    def tasks() -> Iterator[Task]:
        for one in plan.planned(lambda number: bool(left[number])):
            job = maker.job(one)
            named = job_bytes(job)
            due = Due(
                number=one.number,
                job_sha256=named.sha256,
                planner=one.planner,
                road_users=len(job.replayed) + len(job.road_users),
                cells=cells_of(one, plan.attribution),
            )
            at_work[named.sha256] = due
            yield job_task(job, named, cells=due.cells)

    cells = sum(itertools.compress(plan.sizes(), left))
    with progress(cells, "futures") as (advance, say):

        def fault(answer: Answer) -> str:
            due = at_work[answer.task.key]
            found = answer.failure if answer.garbled else fault_in(answer.message.part, due)
            if found:
                text = f"job {due.number}: worker {answer.worker_id} gave no part: {found}"
                if answer.worker_id in told:
                    log.warning("%s", text)
                else:
                    told.add(answer.worker_id)
                    say(f"{text}; more of its kind are in the log")
            return found

        for answer in answers(runner, tasks(), fault_in=fault):
            due = at_work.pop(answer.task.key)
            if answer.message is not None:
                parts.write(due.number, answer.message.part)
            else:
                say(f"failed: job {due.number}: {answer.failure}")
                request = answer.task.question
                assert isinstance(request, JobRequest)
                recorded = JobBytes(bytes(request.job), request.sha256)
                part = finished_part(
                    request.decoded(), recorded, None, due.cells, failure=answer.failure
                )
                parts.write(due.number, part)
            advance(f"{due.cells.junction_id} {due.planner}", by=len(due.cells.cases))
