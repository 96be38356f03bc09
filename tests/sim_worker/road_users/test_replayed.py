"""Recorded road users in the futures of a job: met, touched and measured as all others are."""

from __future__ import annotations

import math

import msgspec
import numpy as np
import pytest

from foretwin.contracts.arrays import Array
from foretwin.contracts.codec import decode, encode
from foretwin.contracts.futures import Future, Job, RecordedRoadUser
from foretwin.sim_worker.batch.batch_simulation import BatchSimulation
from foretwin.sim_worker.futures.result_digest import result_digest
from foretwin.sim_worker.futures.run_job import run_job
from foretwin.sim_worker.metrics.table import METRICS
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.sim_worker.vehicle.reference_points import box_centre_from_base_m
from tests.sim_worker.places import crossroads, happening, job, state_at

CAR = load_vehicle()
FRONT_M = box_centre_from_base_m(CAR) + CAR.length_m.value / 2.0
EVERY = tuple(
    name
    for name, metric in METRICS.items()
    if not metric.series and "reference" not in metric.needs
)


@pytest.fixture(scope="module")
def stage() -> BatchSimulation:
    return BatchSimulation(crossroads(), CAR, nsim=8)


def _moving(
    name: str, time_s: Array, from_xy: tuple[float, float], yaw_rad: float, speed_mps: float
) -> RecordedRoadUser:
    along = speed_mps * time_s
    x, y = from_xy[0] + along * math.cos(yaw_rad), from_xy[1] + along * math.sin(yaw_rad)
    return RecordedRoadUser(
        user_id=name, kind="car", time_s=time_s, size_m=(4.0, 2.0),
        poses=np.column_stack([x, y, np.full(len(time_s), yaw_rad)]),
        speed_mps=np.full(len(time_s), speed_mps), gone_after=np.zeros(len(time_s), dtype=bool),
    )  # fmt: skip


def _job(*users: RecordedRoadUser, planners: tuple[str, ...] = ("constant_speed",)) -> Job:
    futures = tuple(Future(index=i, name=p, planner=p) for i, p in enumerate(planners))
    return msgspec.structs.replace(job(futures), replayed=users)


def test_a_standing_car_is_touched_when_the_way_is_driven(stage: BatchSimulation) -> None:
    # Rear first, at 6.5 m/s, from 30 m ahead; its samples are not those of the control ticks.
    times_s = np.arange(-0.03, 6.0, 0.11)
    start_x = -50.0 + FRONT_M + 2.0 + 30.0
    user = _moving("back", times_s, (start_x, -1.5), math.pi, 6.5)
    question = msgspec.structs.replace(
        _job(user), state=state_at(-50.0, -1.5, speed=0.0), cruise_speed_mps=0.0, accidents=True
    )
    result = run_job(question, stage)
    assert result.outcome.collision_time_s[0] == pytest.approx(30.0 / 6.5, abs=1e-3)
    assert result.outcome.collision_with[0] == 1
    assert result.accidents[0].closing_mps == pytest.approx(6.5, abs=0.01)
    end = result.road_users.poses[0, :, 0]
    there = result.trajectory.time_s <= times_s[-1]
    assert np.isfinite(end[:, 0]).tolist() == there.tolist()
    assert end[there, 0] == pytest.approx(start_x - 6.5 * result.trajectory.time_s[there], abs=1e-5)


def test_who_is_away_is_not_touched_and_who_comes_back_is(stage: BatchSimulation) -> None:
    times_s = np.array([0.0, 1.0, 9.0])
    stands = _moving("stands", times_s, (0.0, -1.5), 0.0, 0.0)
    away = msgspec.structs.replace(stands, gone_after=np.array([False, True, False]))
    assert run_job(_job(stands), stage).outcome.collided.tolist() == [True]
    passed = run_job(_job(away), stage)
    assert passed.outcome.collided.tolist() == [False]
    # Seen from 8 m/s for a second, then never again.
    assert passed.outcome.min_clearance_m[0] == pytest.approx(50.0 - FRONT_M - 2.0 - 8.0, abs=0.1)


def test_planners_drive_and_all_metrics_are_told_among_those_who_come_and_go(
    stage: BatchSimulation,
) -> None:
    crossing = _moving("crossing", np.arange(1.03, 5.0, 0.1), (1.5, -30.0), math.pi / 2.0, 6.0)
    lead = _moving("lead", np.arange(0.0, 3.0, 0.1), (-20.0, -1.5), 0.0, 5.0)
    planners = ("pure_pursuit_idm", "gap_acceptance", "frenet_lattice", "constant_speed")
    question = msgspec.structs.replace(
        _job(crossing, lead, planners=planners), metrics=EVERY, accidents=True
    )
    result = run_job(question, stage)
    assert result.outcome.valid.all()
    assert result.outcome.failures == ()
    # Who comes or goes did not brake: nobody is told to have gone from 5 m/s to 0 in an instant.
    assert np.nanmax(result.metrics["required_deceleration"]) < 20.0
    assert (result.metrics["min_clearance"] < 30.0).all()
    assert result_digest(result) == result_digest(run_job(question, stage))
    again = decode(encode(question), Job).message
    assert result_digest(run_job(again, stage)) == result_digest(result)


def test_scenarios_and_seen_road_users_come_after_them(stage: BatchSimulation) -> None:
    lead = _moving("lead", np.arange(0.0, 9.0, 0.5), (60.0, 40.0), 0.0, 0.0)
    meets = happening(1, "scp", planner="constant_speed")
    question = job((Future(index=0, name="alone"), meets), accidents=True)
    before = run_job(question, stage)
    after = run_job(msgspec.structs.replace(question, replayed=(lead,)), stage)
    assert after.road_users.poses[:, :, 1:] == pytest.approx(before.road_users.poses, nan_ok=True)
    assert [a.road_user for a in after.accidents] == [a.road_user + 1 for a in before.accidents]
    assert len(after.accidents) == 1
