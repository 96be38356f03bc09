"""What jobs and the parent cost, fitted on some sweeps, and how well that predicts others."""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from tests.scale.measured import FITTED, HELD_OUT, Measured
from tests.scale.sweep_model import SweepCosts, SweepModel
from tests.scale.sweep_runs import SweepRun

BESIDE = (2, 16)
"""What tells the load of a repeat: a fitted configuration in which all cores were wanted."""


class Prediction(NamedTuple):
    """A sweep that was not fitted: what was predicted and what its repeats took, in seconds."""

    workers: int
    futures_per_job: int
    what: str
    predicted_s: tuple[float, ...]
    """One for each repeat: only the load of the machine differs."""
    measured_s: tuple[float, ...]

    @property
    def errors(self) -> tuple[float, ...]:
        """Return predicted over measured less one, by repeat."""
        return tuple(
            predicted / measured - 1.0
            for predicted, measured in zip(self.predicted_s, self.measured_s, strict=True)
        )

    @property
    def median_error(self) -> float:
        """Return the error of a typical repeat."""
        return statistics.median(self.errors)


def fitted_costs(measured: Measured, runs: Sequence[SweepRun]) -> SweepCosts:
    """Return the costs by least squares: jobs of one worker tell what a job takes, those of several
    by how much longer it takes beside another.

    Others are at work beside both alike, so what they slow is in all that is measured.
    """
    alone = [job for run in runs if run.workers == 1 for job in run.jobs]
    job_s, future_s, first_s = map(
        float,
        _least_squares(
            [(1.0, job.futures, job.compiled) for job in alone], [job.cpu_s for job in alone]
        ),
    )
    contention = max(
        statistics.median(
            run.jobs_cpu_s
            / sum(job_s + future_s * job.futures + first_s * job.compiled for job in run.jobs)
            for run in runs
            if run.workers > 1
        )
        - 1.0,
        0.0,
    )

    def slowed(run: SweepRun) -> float:
        return 1.0 + (contention if run.workers > 1 else 0.0)

    own = [run for run in measured.runs if run in runs or run.vehicles > 1]
    _, parent_job_s, parent_future_s = map(
        float,
        _least_squares(
            [(1.0, len(run.jobs), run.futures) for run in own],
            [run.parent_cpu_s / slowed(run) for run in own],
        ),
    )
    few, many = measured.dispatched[0], measured.dispatched[-1]
    gaps = [gap for run in runs for worker in run.by_worker().values() for gap in worker.gaps_s]
    return SweepCosts(
        job_s=job_s,
        future_s=future_s,
        first_s=first_s,
        parent_job_s=parent_job_s,
        parent_future_s=parent_future_s,
        parent_worker_s=max(many.cpu_s - few.cpu_s, 0.0) / (many.workers - few.workers),
        between_s=statistics.median(gaps),
        contention=contention,
    )


def _least_squares(rows: Sequence[tuple[float, ...]], values: Sequence[float]) -> Array:
    """Return the factors, none below 0, that explain values best.

    Not by their shares: a sum of jobs is wanted, and shares make sums too small.
    """
    each = np.array(values)
    table = np.array(rows, dtype=float)
    kept = list(range(table.shape[1]))
    while True:
        found, *_ = np.linalg.lstsq(table[:, kept], each, rcond=None)
        if (found >= 0.0).all():
            factors = np.zeros(table.shape[1])
            factors[kept] = found
            return factors
        kept.pop(int(np.argmin(found)))


def predictions(measured: Measured) -> list[Prediction]:
    """Return what the model, fitted on some sweeps, says of the others.

    CPU time of the jobs; wall time on idle cores, held against the measured one less what jobs were
    kept from a processor; and wall time beside as many others as the fitted sweeps of the same
    repeat had.
    """
    runs = [run for pair in FITTED for run in measured.runs_of(*pair)]
    costs = fitted_costs(measured, runs)
    found = []
    for workers, size in HELD_OUT:
        held = measured.runs_of(workers, size)
        shapes = measured.jobs_of(size)
        idle = SweepModel(costs, workers=workers, cores=measured.cores).play(shapes)
        # Beside another job, all of them take longer.
        cpu_s = (idle.jobs_cpu_s * (1.0 + costs.contention),) * len(held)
        jobs_cpu_s = tuple(run.jobs_cpu_s for run in held)
        found.append(Prediction(workers, size, "CPU of the jobs", cpu_s, jobs_cpu_s))
        if workers <= measured.cores:
            unhindered_s = tuple(run.unhindered_s for run in held)
            alone_s = (idle.wall_s,) * len(held)
            found.append(Prediction(workers, size, "wall, idle cores", alone_s, unhindered_s))
        beside = []
        for repeat in range(len(held)):
            others = _others(measured.runs_of(*BESIDE)[repeat], measured.cores)
            model = SweepModel(costs, workers=workers, cores=measured.cores, others=others)
            beside.append(model.play(shapes).wall_s)
        walls = tuple(run.makespan_s for run in held)
        found.append(Prediction(workers, size, "wall, as loaded", tuple(beside), walls))
    return found


def _others(run: SweepRun, cores: int) -> float:
    """Return how many threads of others wanted a core, by the share of one that a job had."""
    return max(cores / run.share_of_core - run.workers, 0.0)
