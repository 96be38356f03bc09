"""Recorded jobs played again, as they were played then."""

from __future__ import annotations

from typing import NamedTuple

import msgspec

from foretwin.contracts.errors import UserError
from foretwin.contracts.futures import EngineName, FuturesResult, Job
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.orchestrator.record.recorded_jobs import RecordedFuture
from foretwin.sim_worker.batch.batch_simulation import BatchSimulation
from foretwin.sim_worker.futures.future_rows import future_rows
from foretwin.sim_worker.futures.run_job import run_alone, run_job, stage_for
from foretwin.sim_worker.futures.scene import SceneMaker
from foretwin.sim_worker.planners.registry import in_another_process

_STANDS_IN = "constant_speed"


class PlayedAgain(NamedTuple):
    """What a job came to now, and the hash of each future's trajectory by its index."""

    result: FuturesResult
    sha256: dict[int, str | None]


class Prepared(NamedTuple):
    """A stage and the scenes of a World, for all jobs that the same vehicle drives in it."""

    world_id: str
    vehicle: VehicleParameters
    stage: BatchSimulation
    scenes: SceneMaker

    def serves(self, job: Job, vehicle: VehicleParameters) -> bool:
        """Whether a job can be played here."""
        return (
            (job.engine, job.world_id, vehicle) == ("mujoco", self.world_id, self.vehicle)
            and len(job.futures) <= self.stage.nsim
            and 1.0 / job.control_hz == self.stage.control_dt_s
        )


def prepared_for(recorded: RecordedFuture) -> Prepared:
    """Return what the job of a recorded future needs, which others of its World may share."""
    job, world = recorded.job, recorded.world
    stage = stage_for(
        "mujoco", world, recorded.vehicle, nsim=len(job.futures), control_hz=job.control_hz
    )
    return Prepared(world.id, recorded.vehicle, stage, SceneMaker(world))


def play_again(
    recorded: RecordedFuture,
    *,
    engine: EngineName | None = None,
    on: Prepared | None = None,
) -> PlayedAgain:
    """Play the whole job of a recorded future, as it was then, or on another engine; `on` what was
    prepared for another job, where that serves.

    Raises UserError where the future was driven by a planner in another process.
    """
    known = recorded.row
    if in_another_process(known.planner):
        raise UserError(
            f"{known.future_id}: driven by {known.planner!r} in another process, whose answers are "
            "not recorded"
        )
    job = _without_others(recorded.job)
    if engine is not None:
        job = msgspec.structs.replace(job, engine=engine)
    if on is not None and on.serves(job, recorded.vehicle):
        result = run_job(job, on.stage, scenes=on.scenes)
    else:
        result = run_alone(job, recorded.world, recorded.vehicle)
    rows = future_rows(job, result, job_sha256=known.job_sha256)
    return PlayedAgain(result, {row["index"]: row.get("trajectory_sha256") for row in rows})


def _without_others(job: Job) -> Job:
    """Let futures that other processes drove be driven by foretwin: to the rest it is the same."""
    futures = tuple(
        msgspec.structs.replace(future, planner=_STANDS_IN)
        if in_another_process(future.planner)
        else future
        for future in job.futures
    )
    return msgspec.structs.replace(job, futures=futures)
