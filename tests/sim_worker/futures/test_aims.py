"""Futures drive at the speeds and take the bends that their job tells."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

from foretwin.contracts.futures import Future
from foretwin.sim_worker.batch.batch_simulation import BatchSimulation
from foretwin.sim_worker.futures.run_job import run_job
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from tests.sim_worker.places import crossroads, job, state_at, straight_path


@pytest.fixture(scope="module")
def stage() -> BatchSimulation:
    return BatchSimulation(crossroads(), load_vehicle(), nsim=2)


def test_a_future_follows_the_speeds_ahead(stage: BatchSimulation) -> None:
    speeds = np.concatenate([np.linspace(8.0, 12.0, 9), np.linspace(11.0, 5.0, 8)])
    futures = (
        Future(index=0, name="n"),
        Future(index=1, name="s", numbers={"target_speed_factor": 0.5}),
    )
    asked = job(futures, state=state_at(-50.0, -1.5, speed=8.0))
    told = msgspec.structs.replace(asked, speed_ahead_mps=speeds)
    nominal, slow = run_job(told, stage).trajectory.states[:, :, 3]
    at = np.interp(np.arange(81) * 0.1, np.arange(17) * 0.5, speeds)

    np.testing.assert_allclose(nominal, at, atol=0.45)
    assert nominal[40] == pytest.approx(12.0, abs=0.4)
    assert (slow[20:] < 0.75 * nominal[20:]).all()


def test_after_the_last_speed_ahead_it_stays(stage: BatchSimulation) -> None:
    told = msgspec.structs.replace(
        job((Future(index=0, name="n"),), state=state_at(-50.0, -1.5, speed=8.0)),
        speed_ahead_mps=np.array([8.0, 8.5, 9.0]),
    )
    speed = run_job(told, stage).trajectory.states[0, :, 3]

    np.testing.assert_allclose(speed[25:], 9.0, atol=0.2)


def test_speeds_ahead_that_stay_are_the_cruise_speed(stage: BatchSimulation) -> None:
    asked = job((Future(index=0, name="n"),), state=state_at(-50.0, -1.5, speed=6.0), cruise=9.0)
    told = msgspec.structs.replace(asked, speed_ahead_mps=np.full(17, 9.0), cruise_speed_mps=9.0)

    np.testing.assert_array_equal(
        run_job(asked, stage).trajectory.states, run_job(told, stage).trajectory.states
    )


def test_lower_limits_slow_a_cruise_speed_and_not_speeds_ahead_which_know_them(
    stage: BatchSimulation,
) -> None:
    way = straight_path()
    limits = np.where(way.xy_m[:, 0] < -20.0, 14.0, 7.0)
    path = msgspec.structs.replace(way, speed_limit_mps=limits)
    asked = job((Future(index=0, name="n"),), path=path, state=state_at(-50.0, -1.5, speed=8.0))
    told = msgspec.structs.replace(asked, speed_ahead_mps=np.full(17, 8.0))
    slowed, as_told = (run_job(one, stage).trajectory.states[0, :, 3] for one in (asked, told))

    np.testing.assert_allclose(slowed[[20, -1]], [8.0, 4.0], atol=0.3)
    np.testing.assert_allclose(as_told, 8.0, atol=0.3)


@pytest.mark.parametrize("ahead", [[], [8.0, float("nan")]])
def test_speeds_ahead_that_are_none_are_refused(ahead: list[float], stage: BatchSimulation) -> None:
    told = msgspec.structs.replace(
        job((Future(index=0, name="n"),)), speed_ahead_mps=np.array(ahead)
    )

    with pytest.raises(ValueError, match="speed_ahead_mps needs speeds"):
        run_job(told, stage)
