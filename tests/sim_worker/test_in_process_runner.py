"""A runner of this process: what a worker's process would answer, without one."""

from __future__ import annotations

from pathlib import Path

import msgspec
import pytest

from foretwin.contracts.codec import write_message
from foretwin.contracts.futures import Job
from foretwin.contracts.job_identity import job_bytes, vehicle_digest
from foretwin.contracts.runner import Runner, Task, answers, job_task
from foretwin.contracts.setup import BusSetup, WorkerSetup
from foretwin.sim_worker.batch.batch_simulation import BatchSimulation
from foretwin.sim_worker.futures.future_mix import plan_futures
from foretwin.sim_worker.futures.result_digest import result_digest
from foretwin.sim_worker.futures.run_job import run_job
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from tests.sim_worker.driving import altered
from tests.sim_worker.in_process_runner import InProcessRunner
from tests.sim_worker.places import crossroads, job

CAR = load_vehicle()
HEAVY = altered(CAR, mass_kg=1500.0, wheelbase_m=2.9, steering_lag_s=0.1)
TWO = job(plan_futures(count=2, seed=0, planners=["pure_pursuit_idm"]), horizon_s=1.0)


@pytest.fixture
def runner(tmp_path: Path) -> Runner:
    write_message(crossroads(), tmp_path / "crossroads.world")
    return InProcessRunner(
        WorkerSetup(
            run_id="r1", process_id="here", vehicle_id="car", bus=BusSetup(endpoint=""),
            log_file="", role="futures", worlds_dir=str(tmp_path), vehicle=CAR,
            swept_vehicles=(CAR, HEAVY),
        )
    )  # fmt: skip


def task(question: Job) -> Task:
    return job_task(question, job_bytes(question))


def test_a_job_comes_to_what_it_always_comes_to(runner: Runner) -> None:
    (answer,) = answers(runner, [task(TWO)])
    assert (answer.task.key, answer.failure, answer.worker_id) == (task(TWO).key, "", "here")
    here = run_job(TWO, BatchSimulation(crossroads(), CAR, nsim=32))
    assert result_digest(answer.message.result) == result_digest(here)


def test_a_job_is_played_with_the_vehicle_that_it_names(runner: Runner) -> None:
    by_vehicle = {}
    for vehicle in (CAR, HEAVY):
        question = msgspec.structs.replace(TWO, vehicle=vehicle_digest(vehicle))
        (answer,) = answers(runner, [task(question)])
        alone = run_job(question, BatchSimulation(crossroads(), vehicle, nsim=2))
        by_vehicle[vehicle.mass_kg.value] = result_digest(answer.message.result)
        assert by_vehicle[vehicle.mass_kg.value] == result_digest(alone)
    assert len(set(by_vehicle.values())) == 2


def test_one_that_cannot_be_played_says_why_and_the_next_one_is(runner: Runner) -> None:
    nowhere = msgspec.structs.replace(TWO, world_id="nowhere")
    lost, kept = answers(runner, [task(nowhere), task(TWO)])
    assert lost.message is None
    assert lost.failure.startswith("FileNotFoundError: ")
    assert kept.message is not None


def test_what_is_cancelled_is_not_played_and_nothing_waits_for_ever(runner: Runner) -> None:
    assert (runner.capacity, runner.workers) == (1, ("here",))
    runner.submit(task(TWO))
    with pytest.raises(ValueError, match="submitted twice"):
        runner.submit(task(TWO))
    runner.cancel(task(TWO).key)
    assert runner.take(None) is None
