from __future__ import annotations

import msgspec
import numpy as np
import pytest

from foretwin.contracts.codec import content_bytes
from foretwin.contracts.futures import Future
from foretwin.sim_worker.engines.engine_stage import EngineStage
from foretwin.sim_worker.futures.result_digest import result_digest
from foretwin.sim_worker.futures.run_job import run_alone, run_job
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from tests.sim_worker.driving import altered, drive, seed, states
from tests.sim_worker.hilly import hilly
from tests.sim_worker.places import box, crossroads, job

COVERS = ("foretwin.sim_worker.engines.registry",)

CAR = load_vehicle()
NOMINAL = job((Future(index=0, name="nominal"),), horizon_s=4.0)
OTHER = msgspec.structs.replace(NOMINAL, engine="multibody")


def test_the_same_job_is_played_by_another_engine_and_ends_near() -> None:
    world = crossroads()
    here, there = run_alone(NOMINAL, world, CAR), run_alone(OTHER, world, CAR)
    assert there.outcome.valid.all()
    apart = here.trajectory.states[0, -1, :2] - there.trajectory.states[0, -1, :2]
    assert 0.0 < np.hypot(*apart) < 0.5
    assert result_digest(there) == result_digest(run_alone(OTHER, world, CAR))


def test_a_job_says_its_engine_and_no_other_plays_it() -> None:
    stage = EngineStage(crossroads(), CAR, engine="multibody", nsim=1)
    with pytest.raises(ValueError, match="a job for the engine mujoco on a stage of multibody"):
        run_job(NOMINAL, stage)
    with pytest.raises(ValueError, match="engine 'carla'"):
        run_alone(msgspec.structs.replace(NOMINAL, engine="carla"), crossroads(), CAR)
    assert content_bytes(NOMINAL) != content_bytes(OTHER)


def test_a_building_is_touched_where_the_cars_are_moved() -> None:
    stage = EngineStage(
        crossroads(buildings=(box(30.0, 0.0, 2.0, 10.0),)), CAR, engine="multibody", nsim=2
    )
    seed(stage, states(2, speed=np.array([10.0, 2.0])))
    touched = []
    for _ in range(60):
        drive(stage, 1)
        touched.append(stage.static_contact.copy())
    front = CAR.length_m.value - CAR.rear_overhang_m.value
    met = int(np.argmax([one[0] for one in touched]))
    assert 10.0 * 0.05 * (met + 1) + front == pytest.approx(28.0, abs=0.6)
    assert not any(one[1] for one in touched)


def test_slopes_are_felt() -> None:
    stage = EngineStage(hilly(0.1), CAR, engine="multibody", nsim=1)
    seed(stage, states(1, speed=10.0))
    slowed = 10.0 - drive(stage, 20)[0, -1, 3]
    expected = 9.81 * 0.1 / np.hypot(1.0, 0.1) / CAR.wheel_inertia_mass_factor.value
    assert slowed == pytest.approx(expected, rel=0.05)


def test_cars_begin_anew_beside_others_and_with_other_parameters() -> None:
    stage = EngineStage(None, CAR, engine="multibody", nsim=2)
    seed(stage, states(2, speed=8.0))
    drive(stage, 10, tire=0.1)
    stage.reseed(
        np.array([1]), states(1, speed=8.0),
        steering_delay_s=np.zeros(1), friction_factor=np.ones(1),
    )  # fmt: skip
    again = drive(stage, 10, tire=0.1)[1, -1]
    seed(stage, states(1, speed=8.0))
    assert drive(stage, 10, tire=0.1)[0, -1] == pytest.approx(again)
    stage.use_vehicle(altered(CAR, wheelbase_m=3.4))
    seed(stage, states(1, speed=8.0))
    assert drive(stage, 10, tire=0.1)[0, -1, 2] < 0.9 * again[2]
