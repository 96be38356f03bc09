"""One row for each future, whether it was live or swept."""

from __future__ import annotations

import hashlib

import msgspec
import numpy as np
import pytest

from foretwin.contracts.futures import Future, SeenRoadUser
from foretwin.contracts.numbers import FUTURE_NUMBERS
from foretwin.sim_worker.batch.batch_simulation import BatchSimulation
from foretwin.sim_worker.futures.future_rows import (
    FUTURE_COLUMNS,
    future_rows,
    motion_sha256,
    road_user_names,
)
from foretwin.sim_worker.futures.run_job import run_job
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from tests.sim_worker.places import crossroads, happening, job

SEEN = SeenRoadUser(
    user_id="7", kind="car", x_m=-30.0, y_m=-1.5, yaw_rad=0.0, speed_mps=0.0, length_m=4.5,
    width_m=1.8,
)  # fmt: skip


def test_a_row_tells_what_was_asked_and_what_became_of_it() -> None:
    blind = Future(
        index=5, name="heedless", planner="constant_speed",
        numbers={"friction_factor": 0.5, "target_speed_factor": 1.1},
    )  # fmt: skip
    asked = msgspec.structs.replace(
        job((happening(2, "scp"), blind), accidents=True), road_users=(SEEN,), metrics=("ttc",)
    )
    result = run_job(asked, BatchSimulation(crossroads(), load_vehicle(), nsim=2), worker_id="w1")
    crossed, crash = future_rows(asked, result, job_sha256="ab" * 32)
    assert set(crossed) | set(crash) <= set(FUTURE_COLUMNS)
    assert [row["future_id"] for row in (crossed, crash)] == ["abababababab-2", "abababababab-5"]
    assert (crash["friction_factor"], crash["target_speed_factor"]) == (0.5, 1.1)
    assert crash["brake_gain"] == FUTURE_NUMBERS["brake_gain"].neutral
    assert dict(crossed["values"]) == asked.futures[0].values
    assert (crash["collided"], crash["collision_with"]) == (True, "road_user")
    assert (crash["accident_with"], crash["accident_kind"]) == ("seen 7", "car")
    assert crash["metric_ttc"] is not None
    assert crossed["collision_time_s"] is None
    assert crash["collision_time_s"] == pytest.approx(result.outcome.collision_time_s[1])
    states, poses = result.trajectory.states[1], result.road_users.poses[1]
    own = hashlib.sha256(
        np.ascontiguousarray(states).tobytes() + np.ascontiguousarray(poses).tobytes()
    )
    assert crash["trajectory_sha256"] == own.hexdigest()
    assert crash["worker_id"] == "w1"
    assert road_user_names(asked, asked.futures[0])[0] == "seen 7"
    assert len(road_user_names(asked, asked.futures[0])) > 1


def test_without_a_result_rows_hold_what_was_asked() -> None:
    (row,) = future_rows(job((happening(0, "scp"),)), None, job_sha256="0" * 64)
    assert (row["scenario"], row["failure"]) == ("scp", "")
    assert "collided" not in row


def test_the_hash_of_a_motion_is_that_of_the_future_in_any_job() -> None:
    alone, crossed = Future(index=5, name="alone"), happening(2, "scp")
    stage = BatchSimulation(crossroads(), load_vehicle(), nsim=2)
    both = run_job(job((crossed, alone)), stage)
    one = run_job(job((alone,)), stage)
    assert both.road_users.poses.shape[2] > one.road_users.poses.shape[2]
    assert motion_sha256(both, 1) == motion_sha256(one, 0) != motion_sha256(both, 0)
    one.trajectory.states[0, -1, 0] += 1e-3
    assert motion_sha256(one, 0) != motion_sha256(both, 1)
    both.road_users.poses[0, 0, 0, 0] += 1e-3
    assert motion_sha256(both, 0) != motion_sha256(run_job(job((crossed,)), stage), 0)
