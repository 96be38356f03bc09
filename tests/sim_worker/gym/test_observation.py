"""The entries of an observation that tell of others and of the car itself, against the scene."""

from __future__ import annotations

from typing import Any

import msgspec
import numpy as np
import pytest

from foretwin.contracts.futures import Future, SeenRoadUser
from foretwin.sim_worker.gym import JunctionEnv
from foretwin.sim_worker.gym.actions import MAX_ACCEL_MPS2
from foretwin.sim_worker.gym.observation import feature_names
from foretwin.sim_worker.vehicle.reference_points import box_centre_from_base_m
from tests.sim_worker.places import crossroads, job

COVERS = ("foretwin.sim_worker.gym.actions",)
PARKED = SeenRoadUser(
    kind="car", x_m=-20.0, y_m=2.5, yaw_rad=0.0, speed_mps=0.0, length_m=4.5, width_m=1.8
)


def environment(**settings: Any) -> JunctionEnv:
    question = job((Future(index=0, name="nominal"),))
    question = msgspec.structs.replace(question, road_users=(PARKED,))
    return JunctionEnv(crossroads(), job=question, **settings)


def test_a_parked_car_is_seen_from_the_middle_of_the_own_box() -> None:
    env = environment(nearest=2)
    vector, _ = env.reset(seed=1)
    seen = dict(zip(env.course.features, vector.tolist(), strict=True))

    x, y, yaw, speed = env.course.rows.stage.states[0, :4]
    assert yaw == pytest.approx(0.0, abs=1e-6)
    middle = x + box_centre_from_base_m(env.course.rows.stage.vehicle)
    assert seen["user0_present"] == 1.0
    assert seen["user0_ahead"] == pytest.approx((PARKED.x_m - middle) / 60.0, abs=1e-3)
    assert seen["user0_left"] == pytest.approx((PARKED.y_m - y) / 60.0, abs=1e-3)
    assert seen["user0_ahead_speed"] == pytest.approx(-speed / 20.0, abs=1e-3)
    assert (seen["user0_heading_cos"], seen["user0_heading_sin"]) == pytest.approx((1.0, 0.0))
    assert (seen["user0_length"], seen["user0_width"]) == pytest.approx((4.5 / 12.0, 0.6))
    assert {value for name, value in seen.items() if name.startswith("user1_")} == {0.0}
    assert seen["lead_gap"] == seen["stop_line"] == 1.0  # nothing in the way
    assert len(feature_names(2)) == len(vector)


def test_an_action_of_one_is_the_greatest_acceleration_and_zero_keeps_the_speed() -> None:
    env = environment(control="along_path", horizon_s=5.0)
    gained = []
    for action in (0.0, 1.0):
        env.reset(seed=1)
        before = env.course.rows.stage.states[0, 3]
        for _ in range(20):
            env.step(np.array([action], np.float32))
        gained.append(env.course.rows.stage.states[0, 3] - before)

    assert gained[0] == pytest.approx(0.0, abs=0.15)
    assert gained[1] == pytest.approx(2.0 * MAX_ACCEL_MPS2, rel=0.25)
