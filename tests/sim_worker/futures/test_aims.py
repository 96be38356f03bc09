"""Futures drive at the speeds and take the bends that their job tells."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

from foretwin.contracts.futures import Future, PathAhead
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


@pytest.mark.parametrize("ahead", [[], [8.0, float("nan")]])
def test_speeds_ahead_that_are_none_are_refused(ahead: list[float], stage: BatchSimulation) -> None:
    told = msgspec.structs.replace(
        job((Future(index=0, name="n"),)), speed_ahead_mps=np.array(ahead)
    )

    with pytest.raises(ValueError, match="speed_ahead_mps needs speeds"):
        run_job(told, stage)


def test_where_the_limit_drops_speeds_ahead_rise_by_its_share(stage: BatchSimulation) -> None:
    path = straight_path()
    limit = np.where(path.xy_m[:, 0] < -45.0, 14.0, 7.0)
    told = msgspec.structs.replace(
        job((Future(index=0, name="n"),), state=state_at(-50.0, -1.5, speed=4.0)),
        path=PathAhead(xy_m=path.xy_m, speed_limit_mps=limit),
        speed_ahead_mps=np.linspace(4.0, 20.0, 17),
    )
    speed = run_job(told, stage).trajectory.states[0, :, 3]

    np.testing.assert_allclose(speed[40:70], 0.5 * (4.0 + 0.2 * np.arange(40, 70)), atol=0.25)


def bend_path(radius_m: float) -> PathAhead:
    """East for 40 m from where cars begin, then a half circle to the left."""
    turned = np.linspace(0.0, np.pi, 90)[1:]
    arc = radius_m * np.stack([np.sin(turned), 1.0 - np.cos(turned)], axis=-1) + [-10.0, -1.5]
    straight = np.stack([np.arange(-70.0, -9.5), np.full(61, -1.5)], axis=-1)
    return PathAhead(xy_m=np.concatenate([straight, arc]), speed_limit_mps=np.full(150, 30.0))


@pytest.mark.parametrize("planner", ["pure_pursuit_idm", "gap_acceptance"])
def test_bends_are_taken_as_the_driver_takes_them(planner: str, stage: BatchSimulation) -> None:
    asked = msgspec.structs.replace(
        job((Future(index=0, name="n", planner=planner),), state=state_at(-50.0, -1.5, speed=9.0)),
        path=bend_path(25.0),
        cruise_speed_mps=12.0,
    )
    across = {}
    for own in (msgspec.UNSET, 2.5, 1.5, 3.5):
        told = msgspec.structs.replace(asked, bend_accel_mps2=own)
        speed = run_job(told, stage).trajectory.states[0, :, 3]
        across[own] = float(speed[60]) ** 2 / 25.0
    assert across[msgspec.UNSET] == across[2.5]
    for own in (1.5, 2.5, 3.5):
        assert across[own] == pytest.approx(own, rel=0.1)


@pytest.mark.parametrize("own", [0.0, -1.0, float("nan"), float("inf")])
def test_what_is_taken_in_bends_has_to_be_a_number_above_0(
    own: float, stage: BatchSimulation
) -> None:
    told = msgspec.structs.replace(job((Future(index=0, name="n"),)), bend_accel_mps2=own)
    with pytest.raises(ValueError, match="bend_accel_mps2 is to be above 0 and finite, not"):
        run_job(told, stage)
