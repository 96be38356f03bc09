"""Messages of the drive as ROS 2 messages in CDR, and back.

| channel | topic | type | exact |
|---|---|---|---|
| gnss | /foretwin/gnss | sensor_msgs/NavSatFix | yes |
| imu | /foretwin/imu | sensor_msgs/Imu, no orientation | yes |
| speed | /foretwin/speed | geometry_msgs/TwistStamped | yes |
| heading | /foretwin/heading | sensor_msgs/Imu, orientation (and rate about z) alone | 1e-15 rad |
| steering | /foretwin/steering | sensor_msgs/JointState: steering_wheel, tire | yes |
| plan | /foretwin/plan | autoware_planning_msgs/Trajectory in the local frame | 1e-9 deg |
| status, objects, signals, end | /foretwin/NAME | std_msgs/String, JSON | yes |
| control, state | /foretwin/NAME_json | std_msgs/String, JSON | yes |

Views for other programs, not read back since they hold less (32-bit numbers, fewer fields):
/foretwin/steering_report (autoware_vehicle_msgs/SteeringReport), /foretwin/control
(ackermann_msgs/AckermannDriveStamped), /foretwin/state (nav_msgs/Odometry, local frame).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import msgspec
import numpy as np

from contracts import drive
from contracts.frames import (
    GeoPoint,
    LocalFrame,
    geo_from_local,
    geo_from_local_yaw,
    local_from_geo,
    local_from_geo_yaw,
)
from contracts.keys import CHANNELS
from telemetry.ros_parts import (
    ACKERMANN,
    ANTENNA_FRAME,
    BASE_FRAME,
    IMU,
    JOINT_STATE,
    MAP_FRAME,
    NAV_SAT_FIX,
    ODOMETRY,
    STEERING_REPORT,
    STRING,
    TRAJECTORY,
    TWIST_STAMPED,
    covariance,
    header_from,
    point_from,
    ros_type,
    stamp_ns_of,
    time_from,
    turn_from,
    twist_from,
    typestore,
    vector_from,
    within_float32,
    yaw_of,
)

TOPIC_PREFIX = "/foretwin/"
WHEEL_JOINT, TIRE_JOINT = "steering_wheel", "tire"
_JSON_ALONE = ("status", "objects", "signals", "end")
_JSON_BESIDE_A_VIEW = ("control", "state")
_UNKNOWN, _DIAGONAL_KNOWN = 0, 2
"""NavSatFix.position_covariance_type."""
_ABSENT = -1.0
"""Imu: the first element of a covariance whose quantity was not measured."""


class RosMessage(NamedTuple):
    """One message ready for a file: topic, full type name, CDR bytes."""

    topic: str
    kind: str
    data: bytes


def messages_from(
    channel: str, message: msgspec.Struct, frame: LocalFrame | None
) -> list[RosMessage]:
    """Return the ROS 2 messages of one message; `frame` is the local frame of plan and state.

    Raises ValueError for a channel that is not written, a stamp that a ROS time cannot hold
    (before 1970 or after 2038-01-19), or a plan or state without a frame.
    """
    if channel in ("plan", "state") and frame is None:
        raise ValueError(f"{channel}: needs a local frame")
    if not 0 <= message.stamp_ns < 2**31 * 10**9:  # type: ignore[attr-defined]
        raise ValueError(
            f"{channel}: stamp {message.stamp_ns} ns fits no ROS time (1970 to 2038)"  # type: ignore[attr-defined]
        )
    if channel in _WRITERS:
        parts = _WRITERS[channel](message, frame)
    elif channel in _JSON_ALONE:
        parts = [(channel, STRING, _json(message))]
    else:
        raise ValueError(f"channel {channel!r} is not written; known: {', '.join(written())}")
    store = typestore()
    return [
        RosMessage(TOPIC_PREFIX + name, kind, bytes(store.serialize_cdr(ros, kind)))
        for name, kind, ros in parts
    ]


def written() -> tuple[str, ...]:
    """Return the channels that can be written."""
    return (*_WRITERS, *_JSON_ALONE)


def message_from(
    topic: str, data: bytes, frame: LocalFrame | None
) -> tuple[str, msgspec.Struct] | None:
    """Return channel and message of one of our own topics, None for views and other topics."""
    name = topic.removeprefix(TOPIC_PREFIX)
    if topic == name:
        return None
    channel = name.removesuffix("_json")
    if channel in _JSON_ALONE or (channel in _JSON_BESIDE_A_VIEW and channel != name):
        text = typestore().deserialize_cdr(data, STRING).data
        return channel, msgspec.json.decode(text, type=CHANNELS[channel].kind)
    if name not in _READERS:
        return None
    kind, read = _READERS[name]
    return name, read(typestore().deserialize_cdr(data, kind), frame)


def _json(message: msgspec.Struct) -> Any:
    return ros_type(STRING)(data=msgspec.json.encode(message).decode())


Parts = list[tuple[str, str, Any]]


def _gnss(message: drive.GnssFix, _frame: LocalFrame | None) -> Parts:
    variance = 0.0 if message.std_m is None else message.std_m**2
    status = ros_type("sensor_msgs/msg/NavSatStatus")(status=0, service=0)
    fix = ros_type(NAV_SAT_FIX)(
        header=header_from(message.stamp_ns, ANTENNA_FRAME),
        status=status,
        latitude=message.position.lat_deg,
        longitude=message.position.lon_deg,
        altitude=message.position.alt_m,
        position_covariance=covariance(3, d0=variance, d1=variance),
        position_covariance_type=_UNKNOWN if message.std_m is None else _DIAGONAL_KNOWN,
    )
    return [("gnss", NAV_SAT_FIX, fix)]


def _gnss_read(ros: Any, _frame: LocalFrame | None) -> drive.GnssFix:
    known = ros.position_covariance_type != _UNKNOWN
    return drive.GnssFix(
        stamp_ns=stamp_ns_of(ros.header.stamp),
        position=GeoPoint(ros.latitude, ros.longitude, ros.altitude),
        std_m=math.sqrt(max(ros.position_covariance[0], 0.0)) if known else None,
    )


def _imu(message: drive.ImuSample, _frame: LocalFrame | None) -> Parts:
    imu = ros_type(IMU)(
        header=header_from(message.stamp_ns, BASE_FRAME),
        orientation=turn_from(0.0),
        orientation_covariance=covariance(3, d0=_ABSENT),
        angular_velocity=vector_from(*message.rate_radps),
        angular_velocity_covariance=covariance(3),
        linear_acceleration=vector_from(*message.accel_mps2),
        linear_acceleration_covariance=covariance(3),
    )
    return [("imu", IMU, imu)]


def _imu_read(ros: Any, _frame: LocalFrame | None) -> drive.ImuSample:
    accel, rate = ros.linear_acceleration, ros.angular_velocity
    return drive.ImuSample(
        stamp_ns=stamp_ns_of(ros.header.stamp),
        accel_mps2=(accel.x, accel.y, accel.z),
        rate_radps=(rate.x, rate.y, rate.z),
    )


def _speed(message: drive.SpeedSample, _frame: LocalFrame | None) -> Parts:
    header = header_from(message.stamp_ns, BASE_FRAME)
    twist = ros_type(TWIST_STAMPED)(header=header, twist=twist_from(message.speed_mps, 0.0))
    return [("speed", TWIST_STAMPED, twist)]


def _speed_read(ros: Any, _frame: LocalFrame | None) -> drive.SpeedSample:
    return drive.SpeedSample(stamp_ns=stamp_ns_of(ros.header.stamp), speed_mps=ros.twist.linear.x)


def _heading(message: drive.HeadingSample, _frame: LocalFrame | None) -> Parts:
    rate = message.yaw_rate_radps
    imu = ros_type(IMU)(
        header=header_from(message.stamp_ns, BASE_FRAME),
        orientation=turn_from(message.yaw_rad),
        orientation_covariance=covariance(3),
        angular_velocity=vector_from(0.0, 0.0, rate or 0.0),
        angular_velocity_covariance=covariance(3, d0=_ABSENT if rate is None else 0.0),
        linear_acceleration=vector_from(0.0, 0.0, 0.0),
        linear_acceleration_covariance=covariance(3, d0=_ABSENT),
    )
    return [("heading", IMU, imu)]


def _heading_read(ros: Any, _frame: LocalFrame | None) -> drive.HeadingSample:
    measured = ros.angular_velocity_covariance[0] != _ABSENT
    return drive.HeadingSample(
        stamp_ns=stamp_ns_of(ros.header.stamp),
        yaw_rad=yaw_of(ros.orientation),
        yaw_rate_radps=ros.angular_velocity.z if measured else None,
    )


def _steering(message: drive.SteeringSample, _frame: LocalFrame | None) -> Parts:
    angles = {WHEEL_JOINT: message.steering_wheel_rad, TIRE_JOINT: message.tire_angle_rad}
    known = {name: angle for name, angle in angles.items() if angle is not None}
    joints = ros_type(JOINT_STATE)(
        header=header_from(message.stamp_ns, BASE_FRAME),
        name=list(known),
        position=np.array(list(known.values()), dtype=np.float64),
        velocity=np.zeros(0),
        effort=np.zeros(0),
    )
    parts: Parts = [("steering", JOINT_STATE, joints)]
    if message.tire_angle_rad is not None:
        report = ros_type(STEERING_REPORT)(
            stamp=time_from(message.stamp_ns),
            steering_tire_angle=within_float32(message.tire_angle_rad),
        )
        parts.append(("steering_report", STEERING_REPORT, report))
    return parts


def _steering_read(ros: Any, _frame: LocalFrame | None) -> drive.SteeringSample:
    angles = dict(zip(ros.name, ros.position.tolist(), strict=True))
    return drive.SteeringSample(
        stamp_ns=stamp_ns_of(ros.header.stamp),
        steering_wheel_rad=angles.get(WHEEL_JOINT),
        tire_angle_rad=angles.get(TIRE_JOINT),
    )


def _control(message: drive.ControlCommand, _frame: LocalFrame | None) -> Parts:
    tire = math.nan if message.tire_angle_rad is None else message.tire_angle_rad
    command = ros_type("ackermann_msgs/msg/AckermannDrive")(
        steering_angle=within_float32(tire),
        steering_angle_velocity=0.0,
        speed=0.0,
        acceleration=within_float32(message.accel_mps2),
        jerk=0.0,
    )
    stamped = ros_type(ACKERMANN)(header=header_from(message.stamp_ns, BASE_FRAME), drive=command)
    return [("control", ACKERMANN, stamped), ("control_json", STRING, _json(message))]


def _plan(message: drive.PlannedTrajectory, frame: LocalFrame | None) -> Parts:
    assert frame is not None
    lat, lon = np.asarray(message.lat_deg), np.asarray(message.lon_deg)
    xy_m = local_from_geo(frame, lat, lon).tolist()
    yaw = local_from_geo_yaw(frame, message.yaw_rad, lat, lon).tolist()
    offsets_ns = np.round(message.time_from_stamp_s * 1e9).astype(np.int64).tolist()
    point, pose = (
        ros_type("autoware_planning_msgs/msg/TrajectoryPoint"),
        ros_type("geometry_msgs/msg/Pose"),
    )
    duration = ros_type("builtin_interfaces/msg/Duration")
    points = [
        point(
            time_from_start=duration(sec=offset // 10**9, nanosec=offset % 10**9),
            pose=pose(position=point_from(x, y, 0.0), orientation=turn_from(heading)),
            longitudinal_velocity_mps=within_float32(speed),
            lateral_velocity_mps=0.0,
            acceleration_mps2=0.0,
            heading_rate_rps=0.0,
            front_wheel_angle_rad=0.0,
            rear_wheel_angle_rad=0.0,
        )
        for offset, (x, y), heading, speed in zip(
            offsets_ns, xy_m, yaw, message.speed_mps.tolist(), strict=True
        )
    ]
    header = header_from(message.stamp_ns, MAP_FRAME)
    return [("plan", TRAJECTORY, ros_type(TRAJECTORY)(header=header, points=points))]


def plan_from_trajectory(ros: Any, frame: LocalFrame | None) -> drive.PlannedTrajectory:
    """Return the plan of an Autoware Trajectory whose frame is `frame`."""
    if frame is None:
        raise ValueError("a trajectory needs the origin of its frame")
    points = ros.points
    xy_m = np.array([(p.pose.position.x, p.pose.position.y) for p in points]).reshape(-1, 2)
    yaw = np.array([yaw_of(p.pose.orientation) for p in points])
    geo = geo_from_local(frame, xy_m)
    return drive.PlannedTrajectory(
        stamp_ns=stamp_ns_of(ros.header.stamp),
        time_from_stamp_s=np.array([stamp_ns_of(p.time_from_start) / 1e9 for p in points]),
        lat_deg=geo[:, 0],
        lon_deg=geo[:, 1],
        yaw_rad=geo_from_local_yaw(frame, yaw, xy_m),
        speed_mps=np.array([p.longitudinal_velocity_mps for p in points]),
    )


def _state(message: drive.VehicleState, frame: LocalFrame | None) -> Parts:
    assert frame is not None
    lat, lon = message.position.lat_deg, message.position.lon_deg
    x_m, y_m = local_from_geo(frame, lat, lon).tolist()
    z_m = message.position.alt_m - frame.origin.alt_m
    yaw = float(local_from_geo_yaw(frame, message.yaw_rad, lat, lon))
    position, heading = message.position_std_m or 0.0, message.yaw_std_rad or 0.0
    pose = ros_type("geometry_msgs/msg/Pose")(
        position=point_from(x_m, y_m, z_m), orientation=turn_from(yaw)
    )
    odometry = ros_type(ODOMETRY)(
        header=header_from(message.stamp_ns, MAP_FRAME),
        child_frame_id=BASE_FRAME,
        pose=ros_type("geometry_msgs/msg/PoseWithCovariance")(
            pose=pose,
            covariance=covariance(6, d0=position**2, d1=position**2, d5=heading**2),
        ),
        twist=ros_type("geometry_msgs/msg/TwistWithCovariance")(
            twist=twist_from(message.speed_mps, message.yaw_rate_radps),
            covariance=covariance(6, d0=(message.speed_std_mps or 0.0) ** 2),
        ),
    )
    return [("state", ODOMETRY, odometry), ("state_json", STRING, _json(message))]


_WRITERS: dict[str, Callable[[Any, LocalFrame | None], Parts]] = {
    "gnss": _gnss,
    "imu": _imu,
    "speed": _speed,
    "heading": _heading,
    "steering": _steering,
    "control": _control,
    "plan": _plan,
    "state": _state,
}
_READERS: dict[str, tuple[str, Callable[[Any, LocalFrame | None], msgspec.Struct]]] = {
    "gnss": (NAV_SAT_FIX, _gnss_read),
    "imu": (IMU, _imu_read),
    "speed": (TWIST_STAMPED, _speed_read),
    "heading": (IMU, _heading_read),
    "steering": (JOINT_STATE, _steering_read),
    "plan": (TRAJECTORY, plan_from_trajectory),
}
