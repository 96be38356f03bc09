"""Road users, signals, status, commands and frames as ROS 2 messages, and back."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from foretwin.contracts import drive
from foretwin.contracts.frames import GeoPoint, LocalFrame, local_from_geo
from foretwin.telemetry.ros_messages.commands import control_from_command
from foretwin.telemetry.ros_messages.foreign import (
    ACCELERATION_UNDEFINED,
    FOREIGN,
    UnusableError,
)
from foretwin.telemetry.ros_messages.motion import odometry_from_state, state_from_odometry
from foretwin.telemetry.ros_messages.objects import (
    detected_from_users,
    predicted_from_users,
    users_from_detected,
    users_from_predicted,
)
from foretwin.telemetry.ros_messages.parts import (
    CONTROL,
    DETECTED_OBJECTS,
    PREDICTED_OBJECTS,
    TRAFFIC_LIGHTS,
    ros_type,
    typestore,
)
from foretwin.telemetry.ros_messages.status import signals_from_ros
from foretwin.telemetry.ros_messages.transforms import TransformTree
from tests.telemetry import drive_messages
from tests.telemetry.autoware_messages import (
    ros_from_signals,
    transform_message,
)

COVERS = (
    "foretwin.telemetry.ros_messages.commands",
    "foretwin.telemetry.ros_messages.shapes",
    "foretwin.telemetry.ros_messages.transforms",
    "foretwin.telemetry.ros_messages.foreign",
)

FRAME = LocalFrame(GeoPoint(52.5121, 13.3925, 34.0))
AT = drive_messages.START_NS
KINDS = ("car", "lorry", "bus", "motorcycle", "bicycle", "pedestrian", "unknown")
users = st.builds(
    drive.RoadUser,
    user_id=st.uuids().map(lambda one: one.hex),
    kind=st.sampled_from(KINDS),
    position=drive_messages.positions,
    yaw_rad=drive_messages.angles,
    speed_mps=st.floats(-10.0, 60.0),
    length_m=st.floats(0.3, 30.0),
    width_m=st.floats(0.3, 4.0),
)


def through_cdr(message: Any, kind: str) -> Any:
    store = typestore()
    return store.deserialize_cdr(bytes(store.serialize_cdr(message, kind)), kind)


def assert_same_user(found: drive.RoadUser, user: drive.RoadUser) -> None:
    assert found.kind == user.kind
    assert found.position.lat_deg == pytest.approx(user.position.lat_deg, abs=1e-9)
    assert found.position.lon_deg == pytest.approx(user.position.lon_deg, abs=1e-9)
    assert found.position.alt_m == pytest.approx(user.position.alt_m, abs=1e-6)
    assert math.cos(found.yaw_rad - user.yaw_rad) == pytest.approx(1.0)
    assert (found.speed_mps, found.length_m, found.width_m) == (
        user.speed_mps,
        user.length_m,
        user.width_m,
    )


@given(said=st.lists(users, max_size=2))
@settings(max_examples=15, deadline=None)
def test_road_users_come_back_from_both_kinds_of_message(said: list[drive.RoadUser]) -> None:
    message = drive.RoadUsers(stamp_ns=AT, users=tuple(said))
    predicted = through_cdr(predicted_from_users(message, FRAME), PREDICTED_OBJECTS)
    back = users_from_predicted(predicted, FRAME, stamp_ns=AT)
    assert (back.stamp_ns, [u.user_id for u in back.users]) == (AT, [u.user_id for u in said])
    detected = through_cdr(detected_from_users(message, FRAME), DETECTED_OBJECTS)
    for found in (back.users, users_from_detected(detected, FRAME, stamp_ns=AT).users):
        for one, user in zip(found, said, strict=True):
            assert_same_user(one, user)


def one_car(user_id: str = "u1", speed_mps: float = 5.0) -> drive.RoadUsers:
    user = drive.RoadUser(
        user_id=user_id,
        kind="car",
        position=FRAME.origin,
        yaw_rad=0.5 * math.pi,
        speed_mps=speed_mps,
        length_m=4.5,
        width_m=1.8,
    )
    return drive.RoadUsers(stamp_ns=AT, users=(user,))


def test_a_predicted_object_goes_straight_on_and_keeps_its_identity() -> None:
    first = predicted_from_users(one_car(), FRAME).objects[0]
    again = predicted_from_users(one_car(), FRAME).objects[0]
    other = predicted_from_users(one_car("u2"), FRAME).objects[0]
    assert bytes(first.object_id.uuid) == bytes(again.object_id.uuid) != bytes(other.object_id.uuid)
    path = first.kinematics.predicted_paths[0]
    assert [round(pose.position.y, 6) for pose in path.path[:5]] == [0.0, 2.5, 5.0, 7.5, 10.0]
    assert (len(path.path), round(path.path[-1].position.y, 6)) == (17, 40.0)
    assert (path.time_step.sec, path.time_step.nanosec) == (0, 500_000_000)


def test_of_a_polygon_the_box_around_it_is_meant_wherever_its_pose_lies() -> None:
    """Perception puts the pose of a hull at the mean of its corners, of which one end has more."""
    message = through_cdr(predicted_from_users(one_car(), FRAME), PREDICTED_OBJECTS)
    shape = message.objects[0].shape
    shape.type = 2
    point = ros_type("geometry_msgs/msg/Point32")
    shape.footprint.points = [
        point(x, y, 0.0) for x, y in ((-0.5, -1.0), (3.5, -1.0), (3.5, 0.5), (-0.5, 0.5))
    ]
    (found,) = users_from_predicted(
        through_cdr(message, PREDICTED_OBJECTS), FRAME, stamp_ns=AT
    ).users
    # It points to the north: 1.5 m ahead is north, 0.25 m to the right east.
    there = local_from_geo(FRAME, found.position.lat_deg, found.position.lon_deg)
    assert there == pytest.approx([0.25, 1.5], abs=1e-6)
    assert (found.length_m, found.width_m) == (4.0, 1.5)


@pytest.mark.parametrize(
    ("ahead_mps", "left_mps", "speed_mps", "yaw_rad", "size_m"),
    [
        (0.0, 5.0, 5.0, math.pi, (1.8, 4.5)),
        (3.0, -4.0, 5.0, 0.5 * math.pi - math.atan2(4.0, 3.0), (4.14, 4.68)),
        (5.0, 1.0, 5.0, 0.5 * math.pi, (4.5, 1.8)),  # slips, as vehicles do
        (-5.0, 0.4, -5.0, 0.5 * math.pi, (4.5, 1.8)),
        (0.0, 0.4, 0.0, 0.5 * math.pi, (4.5, 1.8)),  # noise of one that stands
    ],
)
def test_who_goes_sideways_points_where_it_goes(
    ahead_mps: float, left_mps: float, speed_mps: float, yaw_rad: float, size_m: tuple[float, ...]
) -> None:
    """Tracks of what has no heading keep the one that they began with: here north."""
    message = through_cdr(predicted_from_users(one_car(), FRAME), PREDICTED_OBJECTS)
    twist = message.objects[0].kinematics.initial_twist_with_covariance.twist
    twist.linear.x, twist.linear.y = ahead_mps, left_mps
    (found,) = users_from_predicted(message, FRAME, stamp_ns=AT).users
    assert found.speed_mps == pytest.approx(speed_mps)
    assert math.cos(found.yaw_rad - yaw_rad) == pytest.approx(1.0)
    assert (found.length_m, found.width_m) == pytest.approx(size_m, abs=0.01)


def test_objects_in_the_axes_of_the_car_are_refused() -> None:
    message = detected_from_users(one_car(), FRAME)
    message.header.frame_id = "base_link"
    with pytest.raises(ValueError, match="frame 'base_link', whose pose is not known"):
        users_from_detected(message, FRAME, stamp_ns=AT)


def test_what_one_may_drive_over_is_no_road_user() -> None:
    message = detected_from_users(one_car(), FRAME)
    message.objects[0].classification[0].label = 10
    assert users_from_detected(message, FRAME, stamp_ns=AT).users == ()


@given(
    colours=st.lists(
        st.sampled_from(["red", "red_amber", "amber", "green", "dark", "unknown"]), max_size=4
    )
)
@settings(max_examples=20, deadline=None)
def test_signal_colours_come_back(colours: list[drive.SignalColour]) -> None:
    said = tuple(
        drive.SignalState(stamp_ns=AT, group_id=str(10 + place), colour=colour)
        for place, colour in enumerate(colours)
    )
    assert signals_from_ros(through_cdr(ros_from_signals(AT, said), TRAFFIC_LIGHTS), AT) == said


def test_a_green_arrow_beside_a_red_light_is_no_colour() -> None:
    message = ros_from_signals(AT, [drive.SignalState(stamp_ns=AT, group_id="7", colour="red")])
    arrow = ros_from_signals(AT, [drive.SignalState(stamp_ns=AT, group_id="7", colour="green")])
    message.traffic_light_groups[0].elements += arrow.traffic_light_groups[0].elements
    assert signals_from_ros(message, AT)[0].colour == "unknown"


def test_a_command_comes_back() -> None:
    command = drive.ControlCommand(stamp_ns=AT, accel_mps2=-0.5, tire_angle_rad=0.125)
    control = control_from_command(command, speed_mps=8.0)
    assert FOREIGN[CONTROL].read(control, AT, None) == (command,)


@pytest.mark.parametrize(
    ("accel_mps2", "defined", "taken"),
    [(0.0, True, True), (0.0, False, False), (-0.75, False, True)],
)
def test_a_0_that_is_not_defined_is_no_command(
    accel_mps2: float, defined: bool, taken: bool
) -> None:
    command = drive.ControlCommand(stamp_ns=AT, accel_mps2=accel_mps2, tire_angle_rad=0.125)
    control = control_from_command(command, speed_mps=8.0)
    control.longitudinal.is_defined_acceleration = defined
    if taken:
        assert FOREIGN[CONTROL].read(control, AT, None) == (command,)
        return
    with pytest.raises(UnusableError, match=ACCELERATION_UNDEFINED):
        FOREIGN[CONTROL].read(control, AT, None)


@pytest.mark.parametrize("tire_rad", [None, math.nan, math.inf])
def test_no_command_is_made_of_a_guess(tire_rad: float | None) -> None:
    command = drive.ControlCommand(stamp_ns=AT, accel_mps2=0.0, tire_angle_rad=tire_rad)
    with pytest.raises(ValueError, match="a command needs a finite tire_angle_rad"):
        control_from_command(command, speed_mps=8.0)


def test_a_state_comes_back_from_its_odometry() -> None:
    state = drive_messages.state(AT)
    odometry = odometry_from_state(state, FRAME)
    back = state_from_odometry(odometry, FRAME, vehicle_id="car", stamp_ns=AT)
    assert back.position.lat_deg == pytest.approx(state.position.lat_deg, abs=1e-9)
    assert back.position.alt_m == pytest.approx(state.position.alt_m)
    assert (back.stamp_ns, back.speed_mps, back.yaw_rate_radps) == (AT, 8.25, 0.1)
    assert back.yaw_rad == pytest.approx(0.5)
    assert back.position_std_m == pytest.approx(0.2)
    assert back.yaw_std_rad is None
    odometry.header.frame_id = "odom"
    with pytest.raises(ValueError, match="odometry in frame 'odom'"):
        state_from_odometry(odometry, FRAME, vehicle_id="car", stamp_ns=AT)


def test_the_antenna_is_found_along_the_chain_of_frames() -> None:
    tree = TransformTree()
    tree.add(
        transform_message(
            AT, parent="base_link", child="kit", place_m=(1.0, 0.0, 1.5), yaw_rad=0.5 * math.pi
        )
    )
    tree.add(
        transform_message(
            AT, parent="kit", child="/gnss_link", place_m=(0.5, 0.0, 0.25), yaw_rad=0.0
        )
    )
    place = tree.place_of("gnss_link", within="base_link")
    assert place is not None
    np.testing.assert_allclose(place, (1.0, 0.5, 1.75), atol=1e-12)
    back = tree.place_of("base_link", within="gnss_link")
    assert back is not None
    np.testing.assert_allclose(back, (-0.5, 1.0, -1.75), atol=1e-12)
    assert tree.place_of("lidar", within="base_link") is None
    assert tree.place_of("base_link", within="base_link") == (0.0, 0.0, 0.0)


def test_frames_in_a_circle_end() -> None:
    tree = TransformTree()
    for parent, child in (("a", "b"), ("b", "a")):
        tree.add(
            transform_message(AT, parent=parent, child=child, place_m=(1.0, 0.0, 0.0), yaw_rad=0.0)
        )
    assert tree.place_of("c", within="a") is None
