"""What a job came to, in one number."""

from __future__ import annotations

import hashlib

from foretwin.contracts.futures import Future
from foretwin.sim_worker.batch.batch_simulation import BatchSimulation
from foretwin.sim_worker.futures.result_digest import result_digest
from foretwin.sim_worker.futures.run_job import run_job
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from tests.sim_worker.places import crossroads, job, state_at

NOMINAL = (Future(index=0, name="nominal"),)


def test_what_a_result_came_to_is_the_same_whoever_computed_it() -> None:
    stage = BatchSimulation(crossroads(), load_vehicle(), nsim=16)
    result = run_job(job(NOMINAL, horizon_s=1.0), stage, worker_id="a")
    other = run_job(job(NOMINAL, horizon_s=1.0), stage, worker_id="b")
    assert result_digest(result) == result_digest(other)
    moved = run_job(job(NOMINAL, state=state_at(-50.0, -1.501), horizon_s=1.0), stage)
    assert result_digest(moved) != result_digest(result)
    assert len(result_digest(result)) == hashlib.sha256().digest_size * 2
