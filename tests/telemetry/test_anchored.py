"""What a car says on its lot is said in the World, with its own units; back, what goes to it."""

from __future__ import annotations

import math
from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.contracts import drive
from foretwin.contracts.anchor import Anchor, AnchorPose
from foretwin.contracts.frames import GeoPoint, geo_pose, local_pose
from foretwin.contracts.keys import CHANNELS, TELEMETRY_CHANNELS
from foretwin.contracts.towards_vehicle import VehicleCommand
from foretwin.telemetry.anchored import (
    lot_from_world_message,
    world_from_lot_info,
    world_from_lot_message,
)
from tests.contracts.test_anchor import LOT, WORLD

TEN = Anchor(lot=LOT, world=WORLD, scale=10.0)
MIRRORED = Anchor(lot=LOT, world=WORLD, scale=10.0, mirrored=True)
metres = st.floats(-150.0, 150.0)


def on(pose: AnchorPose, along_m: float, left_m: float, yaw_rad: float = 0.0) -> dict[str, Any]:
    """Return a place that far along and to the left of a pose, turned by a yaw."""
    cos, sin = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
    x_m, y_m = cos * along_m - sin * left_m, sin * along_m + cos * left_m
    at = geo_pose(pose.frame, x_m, y_m, pose.yaw_rad + yaw_rad, alt_m=pose.alt_m)
    return at._asdict()


def seen_from(pose: AnchorPose, position: GeoPoint, yaw_rad: float = 0.0) -> tuple[float, ...]:
    """Return how far along and to the left of a pose a place is, and the yaw from it."""
    x_m, y_m, yaw = local_pose(pose.frame, position, yaw_rad)
    cos, sin = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
    turned = math.remainder(yaw - pose.yaw_rad, math.tau)
    return cos * x_m + sin * y_m, cos * y_m - sin * x_m, turned


def user(**place: Any) -> drive.RoadUser:
    return drive.RoadUser(
        user_id="a", kind="car", speed_mps=3.0, length_m=0.45, width_m=0.2, **place
    )


def test_without_an_anchor_nothing_is_touched():
    fix = drive.GnssFix(stamp_ns=1, position=GeoPoint(1.0, 2.0))
    assert world_from_lot_message(None, fix) is fix
    assert lot_from_world_message(None, fix) is fix


def test_a_fix_is_ten_times_as_far_from_the_anchor_and_ten_times_as_rough():
    at = on(LOT, 3.0, 2.0)["position"]
    there = world_from_lot_message(TEN, drive.GnssFix(stamp_ns=1, position=at, std_m=0.02))
    assert seen_from(WORLD, there.position)[:2] == pytest.approx((30.0, 20.0), abs=1e-4)
    assert there.std_m == pytest.approx(0.2)
    unknown = drive.GnssFix(stamp_ns=1, position=at)
    assert world_from_lot_message(TEN, unknown).std_m is None


def test_a_heading_is_turned_with_the_anchor():
    given_yaw = on(LOT, 0.0, 0.0, 0.4)["yaw_rad"]
    sample = drive.HeadingSample(stamp_ns=1, yaw_rad=given_yaw, yaw_rate_radps=0.3)
    for anchor, side in ((TEN, 1.0), (MIRRORED, -1.0)):
        there = world_from_lot_message(anchor, sample)
        turned = math.remainder(there.yaw_rad - WORLD.yaw_rad, math.tau)
        assert turned == pytest.approx(side * 0.4, abs=1e-9)
        assert there.yaw_rate_radps == pytest.approx(side * 0.3)


def test_motion_goes_with_the_scale_gravity_and_turning_do_not():
    imu = drive.ImuSample(stamp_ns=1, accel_mps2=(0.1, 0.2, 9.8), rate_radps=(0.01, 0.02, 0.3))
    assert world_from_lot_message(TEN, imu) == drive.ImuSample(
        stamp_ns=1, accel_mps2=(1.0, 2.0, 9.8), rate_radps=(0.01, 0.02, 0.3)
    )
    assert world_from_lot_message(MIRRORED, imu) == drive.ImuSample(
        stamp_ns=1, accel_mps2=(1.0, -2.0, 9.8), rate_radps=(-0.01, 0.02, -0.3)
    )
    speed = drive.SpeedSample(stamp_ns=1, speed_mps=0.8)
    assert world_from_lot_message(TEN, speed).speed_mps == pytest.approx(8.0)
    control = drive.ControlCommand(stamp_ns=1, accel_mps2=0.1, tire_angle_rad=0.2)
    there = world_from_lot_message(MIRRORED, control)
    assert (there.accel_mps2, there.tire_angle_rad, there.steering_wheel_rad) == (1.0, -0.2, None)


def test_steering_angles_stay_and_change_sides_where_it_is_mirrored():
    steering = drive.SteeringSample(stamp_ns=1, steering_wheel_rad=1.5, tire_angle_rad=0.1)
    assert world_from_lot_message(TEN, steering) == steering
    there = world_from_lot_message(MIRRORED, steering)
    assert (there.steering_wheel_rad, there.tire_angle_rad) == (-1.5, -0.1)


def test_indicators_change_sides_where_it_is_mirrored():
    status = drive.VehicleStatus(stamp_ns=1, gear="drive", indicator="left")
    assert world_from_lot_message(TEN, status) == status
    assert world_from_lot_message(MIRRORED, status).indicator == "right"
    hazard = msgspec.structs.replace(status, indicator="hazard")
    assert world_from_lot_message(MIRRORED, hazard) == hazard


def test_a_plan_lies_along_the_way_in_the_world():
    places = [on(LOT, along_m, 1.0, 0.1) for along_m in (0.0, 1.0, 2.0)]
    plan = drive.PlannedTrajectory(
        stamp_ns=1,
        time_from_stamp_s=np.array([0.0, 1.0, 2.0]),
        lat_deg=np.array([one["position"].lat_deg for one in places]),
        lon_deg=np.array([one["position"].lon_deg for one in places]),
        yaw_rad=np.array([one["yaw_rad"] for one in places]),
        speed_mps=np.array([1.0, 1.0, 0.5]),
    )
    there = world_from_lot_message(MIRRORED, plan)
    columns = zip(there.lat_deg, there.lon_deg, there.yaw_rad, strict=True)
    seen = [seen_from(WORLD, GeoPoint(float(a), float(b)), float(yaw)) for a, b, yaw in columns]
    wanted = [(0.0, -10.0, -0.1), (10.0, -10.0, -0.1), (20.0, -10.0, -0.1)]
    np.testing.assert_allclose(seen, wanted, atol=1e-4)
    assert there.speed_mps.tolist() == [10.0, 10.0, 5.0]
    assert there.time_from_stamp_s.tolist() == [0.0, 1.0, 2.0]


def test_who_is_really_there_is_moved_to_the_world_with_the_car():
    seen = drive.RoadUsers(stamp_ns=1, users=(user(**on(LOT, 4.0, -1.0, 0.2)),))
    (there,) = world_from_lot_message(TEN, seen).users
    place = seen_from(WORLD, there.position, there.yaw_rad)
    assert place == pytest.approx((40.0, -10.0, 0.2), abs=1e-4)
    assert (there.speed_mps, there.length_m, there.width_m) == pytest.approx((30.0, 4.5, 2.0))


def test_the_route_begins_and_ends_in_the_world():
    start, goal = (drive.RoutePose(**on(LOT, along_m, 0.0)) for along_m in (0.0, 5.0))
    there = world_from_lot_message(TEN, drive.RouteToGoal(stamp_ns=1, start=start, goal=goal))
    assert seen_from(WORLD, *msgspec.structs.astuple(there.start)) == pytest.approx(
        (0.0, 0.0, 0.0), abs=1e-6
    )
    assert seen_from(WORLD, *msgspec.structs.astuple(there.goal)) == pytest.approx(
        (50.0, 0.0, 0.0), abs=1e-4
    )


def test_the_antenna_is_moved_with_the_car():
    info = drive.VehicleInfo(vehicle_id="a", time_base="utc", start_stamp_ns=0)
    assert world_from_lot_info(TEN, info) is info
    placed = msgspec.structs.replace(info, body_from_antenna_m=(0.1, 0.02, 0.12))
    assert world_from_lot_info(None, placed) is placed
    there = world_from_lot_info(MIRRORED, placed)
    assert there.body_from_antenna_m == pytest.approx((1.0, -0.2, 1.2))


def test_lights_and_the_end_are_the_same_in_both():
    for one in (
        drive.SignalState(stamp_ns=1, group_id="g", colour="red"),
        drive.DriveEnd(stamp_ns=1, published={"gnss": 1}),
    ):
        assert world_from_lot_message(MIRRORED, one) is one


def test_every_channel_of_a_vehicle_was_thought_of():
    """A new one has to be added here and, where it tells of places or lengths, to the boundary."""
    assert set(TELEMETRY_CHANNELS) == {
        "gnss", "imu", "speed", "heading", "steering", "control", "plan", "status", "objects",
        "signals", "end",
    }  # fmt: skip
    assert CHANNELS["route"].kind is drive.RouteToGoal


@given(along_m=metres, left_m=metres, yaw_rad=st.floats(-3.0, 3.0), mirrored=st.booleans())
def test_road_users_that_go_out_and_come_back_are_where_they_were(
    along_m: float, left_m: float, yaw_rad: float, mirrored: bool
):
    anchor = msgspec.structs.replace(TEN, mirrored=mirrored)
    users = drive.RoadUsers(stamp_ns=1, users=(user(**on(WORLD, along_m, left_m, yaw_rad)),))
    (back,) = world_from_lot_message(anchor, lot_from_world_message(anchor, users)).users
    place = seen_from(WORLD, back.position, back.yaw_rad)
    assert place[:2] == pytest.approx((along_m, left_m), abs=1e-3)
    assert math.cos(place[2] - yaw_rad) == pytest.approx(1.0, abs=1e-9)
    assert (back.speed_mps, back.length_m) == pytest.approx((3.0, 0.45))


def test_a_state_goes_to_the_car_as_its_lot_knows_it():
    state = drive.VehicleState(
        vehicle_id="a",
        stamp_ns=1,
        speed_mps=8.0,
        yaw_rate_radps=0.3,
        accel_mps2=1.0,
        tire_angle_rad=0.1,
        position_std_m=0.5,
        speed_std_mps=0.1,
        map_shift_m=(1.0, 2.0),
        **on(WORLD, 30.0, 20.0, 0.1),
    )
    there = lot_from_world_message(MIRRORED, state)
    assert seen_from(LOT, there.position, there.yaw_rad) == pytest.approx(
        (3.0, -2.0, -0.1), abs=1e-4
    )
    assert (there.speed_mps, there.accel_mps2, there.position_std_m) == pytest.approx(
        (0.8, 0.1, 0.05)
    )
    assert (there.yaw_rate_radps, there.tire_angle_rad) == (-0.3, -0.1)
    assert (there.speed_std_mps, there.map_shift_m) == (pytest.approx(0.01), None)


def test_a_command_goes_to_the_car_in_its_own_size():
    command = VehicleCommand(
        stamp_ns=1, sent_mono_ns=2, tire_angle_rad=0.1, accel_mps2=1.0, speed_mps=8.0, number=7
    )
    there = lot_from_world_message(MIRRORED, command)
    assert (there.tire_angle_rad, there.accel_mps2, there.speed_mps) == (-0.1, 0.1, 0.8)
    assert (there.number, there.sent_mono_ns) == (7, 2)


def test_nothing_else_goes_to_a_vehicle():
    with pytest.raises(TypeError, match="SpeedSample"):
        lot_from_world_message(TEN, drive.SpeedSample(stamp_ns=1, speed_mps=0.0))
