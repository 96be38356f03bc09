"""64 futures between 200 buildings and 20 others, all metrics on, against stepping in C."""

from __future__ import annotations

import numpy as np

from foretwin.sim_worker.batch.batch_simulation import BatchSimulation
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from tests.benchmarks import busy_junction, scenes
from tests.benchmarks.bare_loop import bare_loop
from tests.benchmarks.closed_loop import SECONDS, job_runner
from tests.benchmarks.measuring import Measurement, cpu_seconds

REPEATS = 12


def measure() -> Measurement:
    """Return milliseconds of CPU per future of 8 s; the bare loop steps a car on open ground."""
    stage = BatchSimulation(
        busy_junction.world(), load_vehicle(), nsim=scenes.FUTURES, control_hz=scenes.CONTROL_HZ
    )
    if stage.model.ngeom < busy_junction.BUILDINGS:
        raise AssertionError(f"the stage has {stage.model.ngeom} geoms only")
    run = job_runner(stage, busy_junction.busy_job())
    flat = BatchSimulation(None, load_vehicle(), nsim=1).model
    speeds = run().road_users.speed_mps
    moving = float(np.mean((speeds > 0.5).any(axis=1).sum(axis=1)))
    if moving < busy_junction.ROAD_USERS:
        raise AssertionError(f"only {moving:g} road users move")
    job_s = bare_s = float("inf")
    with bare_loop(flat, seconds=SECONDS, speed_mps=scenes.SPEED_MPS) as bare:
        for _ in range(REPEATS):
            job_s = min(job_s, cpu_seconds(run))
            bare_s = min(bare_s, bare())
    per_future = 1000.0 / scenes.FUTURES
    return Measurement(job_s * per_future, "CPU ms per future", bare_s * per_future)
