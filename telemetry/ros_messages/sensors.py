"""What a vehicle measures as ROS 2 messages, and back; the table stands in ros_messages."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from foretwin.contracts import drive
from foretwin.contracts.frames import GeoPoint, LocalFrame
from foretwin.telemetry.ros_messages.parts import (
    ANTENNA_FRAME,
    BASE_FRAME,
    IMU,
    JOINT_STATE,
    NAV_SAT_FIX,
    STEERING_REPORT,
    TWIST_STAMPED,
    Parts,
    covariance,
    header_from,
    ros_type,
    stamp_ns_of,
    time_from,
    turn_from,
    twist_from,
    vector_from,
    within_float32,
    yaw_of,
)

WHEEL_JOINT, TIRE_JOINT = "steering_wheel", "tire"
_UNKNOWN, _DIAGONAL_KNOWN = 0, 2
"""NavSatFix.position_covariance_type."""
_ABSENT = -1.0
"""Imu: the first element of a covariance whose quantity was not measured."""


def ros_from_gnss(message: drive.GnssFix, _frame: LocalFrame | None) -> Parts:
    """Return the ROS 2 messages of one gnss message."""
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


def gnss_from_ros(ros: Any, _frame: LocalFrame | None) -> drive.GnssFix:
    """Return the gnss message of one ROS 2 message."""
    known = ros.position_covariance_type != _UNKNOWN
    return drive.GnssFix(
        stamp_ns=stamp_ns_of(ros.header.stamp),
        position=GeoPoint(ros.latitude, ros.longitude, ros.altitude),
        std_m=math.sqrt(max(ros.position_covariance[0], 0.0)) if known else None,
    )


def ros_from_imu(message: drive.ImuSample, _frame: LocalFrame | None) -> Parts:
    """Return the ROS 2 messages of one imu message."""
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


def imu_from_ros(ros: Any, _frame: LocalFrame | None) -> drive.ImuSample:
    """Return the imu message of one ROS 2 message."""
    accel, rate = ros.linear_acceleration, ros.angular_velocity
    return drive.ImuSample(
        stamp_ns=stamp_ns_of(ros.header.stamp),
        accel_mps2=(accel.x, accel.y, accel.z),
        rate_radps=(rate.x, rate.y, rate.z),
    )


def ros_from_speed(message: drive.SpeedSample, _frame: LocalFrame | None) -> Parts:
    """Return the ROS 2 messages of one speed message."""
    header = header_from(message.stamp_ns, BASE_FRAME)
    twist = ros_type(TWIST_STAMPED)(header=header, twist=twist_from(message.speed_mps, 0.0))
    return [("speed", TWIST_STAMPED, twist)]


def speed_from_ros(ros: Any, _frame: LocalFrame | None) -> drive.SpeedSample:
    """Return the speed message of one ROS 2 message."""
    return drive.SpeedSample(stamp_ns=stamp_ns_of(ros.header.stamp), speed_mps=ros.twist.linear.x)


def ros_from_heading(message: drive.HeadingSample, _frame: LocalFrame | None) -> Parts:
    """Return the ROS 2 messages of one heading message."""
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


def heading_from_ros(ros: Any, _frame: LocalFrame | None) -> drive.HeadingSample:
    """Return the heading message of one ROS 2 message."""
    measured = ros.angular_velocity_covariance[0] != _ABSENT
    return drive.HeadingSample(
        stamp_ns=stamp_ns_of(ros.header.stamp),
        yaw_rad=yaw_of(ros.orientation),
        yaw_rate_radps=ros.angular_velocity.z if measured else None,
    )


def ros_from_steering(message: drive.SteeringSample, _frame: LocalFrame | None) -> Parts:
    """Return the ROS 2 messages of one steering message."""
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


def steering_from_ros(ros: Any, _frame: LocalFrame | None) -> drive.SteeringSample:
    """Return the steering message of one ROS 2 message."""
    angles = dict(zip(ros.name, ros.position.tolist(), strict=True))
    return drive.SteeringSample(
        stamp_ns=stamp_ns_of(ros.header.stamp),
        steering_wheel_rad=angles.get(WHEEL_JOINT),
        tire_angle_rad=angles.get(TIRE_JOINT),
    )
