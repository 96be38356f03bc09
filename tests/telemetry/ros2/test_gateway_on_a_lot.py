"""A car on an empty lot: heard in the World, and told of its lot what is in the World."""

from __future__ import annotations

import math
from typing import Any

import msgspec
import pytest

from foretwin.contracts.anchor import Anchor, AnchorPose
from foretwin.contracts.drive import RoadUser, RoadUsers
from foretwin.contracts.frames import geo_pose
from foretwin.contracts.simulation import PlaneState
from foretwin.telemetry.ros_messages.parts import (
    CONTROL,
    ODOMETRY,
    PREDICTED_OBJECTS,
    typestore,
    yaw_of,
)
from tests.contracts.mirror_samples import mirror_sample
from tests.telemetry.ros2.gateway_ground import FIX_KEY, fix
from tests.telemetry.ros2.test_gateway import Ground, S, state

ANCHOR = Anchor(
    lot=AnchorPose(lat_deg=52.5, lon_deg=13.4, yaw_deg=0.0),
    world=AnchorPose(lat_deg=48.1, lon_deg=11.5, yaw_deg=90.0),
    scale=10.0,
)
"""East on the lot is north in the World, and a metre ten."""


def test_a_car_on_a_lot_is_heard_in_the_world_and_told_of_its_lot() -> None:
    ground = Ground(enabled=True, flag=True, anchor=ANCHOR)
    ground.arrive(FIX_KEY, fix(5 * S, 52.5, 13.4))
    heard = ground.inbox.take()
    assert heard is not None
    at = heard.message()
    assert (at.position.lat_deg, at.position.lon_deg) == pytest.approx((48.1, 11.5), abs=1e-9)
    assert at.std_m == pytest.approx(2.0)

    north = geo_pose(ANCHOR.world.frame, 0.0, 50.0, math.pi / 2)
    ground.say_everything()
    ground.step(100.0)
    moving = msgspec.structs.replace(
        state(6 * S), position=north.position, yaw_rad=north.yaw_rad, speed_mps=8.0
    )
    ground.bus.publish("state", moving, vehicle="ego")
    user = RoadUser(
        user_id="u", kind="pedestrian", position=north.position, yaw_rad=north.yaw_rad,
        speed_mps=1.5, length_m=5.0, width_m=5.0, virtual=True,
    )  # fmt: skip
    ground.bus.publish("virtual_objects", RoadUsers(stamp_ns=6 * S, users=(user,)), run="r")
    ground.step()
    (seen,) = read(PREDICTED_OBJECTS, ground.foreign.on("/perception/objects")[-1]).objects
    pose = seen.kinematics.initial_pose_with_covariance.pose
    assert (pose.position.x, pose.position.y) == pytest.approx((5.0, 0.0), abs=1e-3)
    assert yaw_of(pose.orientation) == pytest.approx(0.0, abs=1e-5)
    assert seen.kinematics.initial_twist_with_covariance.twist.linear.x == pytest.approx(0.15)
    (control,) = ground.foreign.on("/control/cmd")
    # 99 m/s in the World are 9.9 on the lot, and its bound is 8.
    speed = read(CONTROL, control).longitudinal.velocity
    assert speed == pytest.approx(8.0)


def test_the_twin_of_a_car_on_a_lot_is_on_the_lot() -> None:
    anchor = msgspec.structs.replace(
        ANCHOR, world=AnchorPose(lat_deg=52.5, lon_deg=13.4, yaw_deg=90.0)
    )
    ground = Ground(enabled=False, flag=False, anchor=anchor)
    ground.bus.publish(
        "mirror", mirror_sample(6 * S, PlaneState(0.0, 20.0, math.pi / 2, 7.0)), run="r"
    )
    ground.step()
    odometry = read(ODOMETRY, ground.foreign.on("/foretwin/twin")[0])
    pose = odometry.pose.pose
    assert (pose.position.x, pose.position.y) == pytest.approx((2.0, 0.0), abs=1e-3)
    assert odometry.twist.twist.linear.x == pytest.approx(0.7)


def read(kind: str, payload: bytes) -> Any:
    return typestore().deserialize_cdr(payload, kind)
