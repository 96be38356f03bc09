"""64 futures of 8 s with a planner on open ground, against stepping the model in C."""

from __future__ import annotations

from collections.abc import Callable

import msgspec

from foretwin.contracts.futures import FuturesResult, Job
from foretwin.sim_worker.batch.batch_simulation import BatchSimulation
from foretwin.sim_worker.futures.future_mix import plan_futures
from foretwin.sim_worker.futures.run_job import run_job
from foretwin.sim_worker.futures.scene import SceneMaker
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from tests.benchmarks import scenes
from tests.benchmarks.bare_loop import bare_loop
from tests.benchmarks.measuring import Measurement, cpu_seconds

REPEATS = 20
SECONDS = scenes.FUTURES * scenes.HORIZON_S


def measure_at(control_hz: float) -> Measurement:
    """Return simulated seconds per CPU second of whole jobs; nobody else is on the road."""
    stage, run = flat_job(control_hz)
    job_s = bare_s = float("inf")
    with bare_loop(stage.model, seconds=SECONDS, speed_mps=scenes.SPEED_MPS) as bare:
        for _ in range(REPEATS):
            job_s = min(job_s, cpu_seconds(run))
            bare_s = min(bare_s, bare())
    return Measurement(SECONDS / job_s, "simulated s per CPU s", SECONDS / bare_s)


def flat_job(control_hz: float) -> tuple[BatchSimulation, Callable[[], FuturesResult]]:
    """Return a stage without buildings and what runs a job on it."""
    world = scenes.street(buildings=0)
    stage = BatchSimulation(
        world, load_vehicle(), nsim=scenes.FUTURES, control_hz=control_hz, threads=1
    )
    futures = plan_futures(count=scenes.FUTURES, seed=0, planners=["pure_pursuit_idm"])
    job = msgspec.structs.replace(scenes.job(world, futures), control_hz=control_hz)
    return stage, job_runner(stage, job)


def job_runner(stage: BatchSimulation, job: Job) -> Callable[[], FuturesResult]:
    """Return what runs a job as a worker does, whose World is prepared; it ran once already."""
    assert stage.world is not None
    maker = SceneMaker(stage.world)

    def run() -> FuturesResult:
        return run_job(job, stage, scenes=maker)

    valid = run().outcome.valid
    if not valid.all():
        raise AssertionError(f"{(~valid).sum()} futures diverged: their cost says nothing")
    return run
