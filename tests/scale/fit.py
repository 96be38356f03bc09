"""What jobs and the parent cost, fitted on some sweeps, and how well that predicts others."""

from __future__ import annotations

import statistics
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from tests.scale.measured import FITTED, HELD_OUT, Measured
from tests.scale.sweep_model import SweepCosts, SweepModel
from tests.scale.sweep_runs import SweepRun


class Prediction(NamedTuple):
    """A sweep that was not fitted: what was predicted and what its repeats took, in seconds."""

    workers: int
    futures_per_job: int
    what: str
    predicted_s: tuple[float, ...]
    """One for each repeat: only what others took of the machine differs."""
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
    kept from a processor; and wall time as it was. What others took of the machine during a sweep
    is given to the model for each.
    """
    runs = [run for pair in FITTED for run in measured.runs_of(*pair)]
    costs = fitted_costs(measured, runs)
    cores, found = measured.cores, []
    for workers, size in HELD_OUT:
        held = measured.runs_of(workers, size)
        shapes = measured.jobs_of(size)

        def told(what: str, said: Iterable[float], was: Iterable[float]) -> None:
            found.append(Prediction(workers, size, what, tuple(said), tuple(was)))  # noqa: B023

        idle = SweepModel(costs, workers=workers, cores=cores).play(shapes)
        # Beside another job, all of them take longer.
        cpu_s = (idle.jobs_cpu_s * (1.0 + costs.contention) for _ in held)
        told("CPU of the jobs", cpu_s, (run.jobs_cpu_s for run in held))
        if workers <= cores:
            told(
                "wall, idle cores", (idle.wall_s for _ in held), (run.unhindered_s for run in held)
            )
        beside = (
            SweepModel(costs, workers=workers, cores=cores, others_cores=run.others_cores)
            for run in held
        )
        walls = (run.makespan_s for run in held)
        told("wall, as it was", (model.play(shapes).wall_s for model in beside), walls)
    return found
