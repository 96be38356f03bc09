"""What a vehicle measures as ROS 2 messages, and back; the table stands in ros_messages.table."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from foretwin.contracts import drive
from foretwin.contracts.frames import GeoPoint, LocalFrame
from foretwin.telemetry.ros_messages import parts
from foretwin.telemetry.ros_messages.parts import covariance, header_from, ros_message

WHEEL_JOINT, TIRE_JOINT = "steering_wheel", "tire"
_UNKNOWN, _DIAGONAL_KNOWN = 0, 2
"""NavSatFix.position_covariance_type."""
_ABSENT = -1.0
"""Imu: the first element of a covariance whose quantity was not measured."""


def ros_from_gnss(message: drive.GnssFix, _frame: LocalFrame | None) -> Any:
    """Return the NavSatFix of a gnss message."""
    variance = 0.0 if message.std_m is None else message.std_m**2
    return ros_message(
        parts.NAV_SAT_FIX,
        header=header_from(message.stamp_ns, parts.ANTENNA_FRAME),
        latitude=message.position.lat_deg,
        longitude=message.position.lon_deg,
        altitude=message.position.alt_m,
        position_covariance=covariance(3, d0=variance, d1=variance),
        position_covariance_type=_UNKNOWN if message.std_m is None else _DIAGONAL_KNOWN,
    )


def gnss_from_ros(ros: Any, stamp_ns: int) -> drive.GnssFix:
    """Return the gnss message of `ros_from_gnss`, to the last bit of its standard deviation."""
    known = ros.position_covariance_type != _UNKNOWN
    position = GeoPoint(ros.latitude, ros.longitude, ros.altitude)
    std_m = math.sqrt(max(ros.position_covariance[0], 0.0)) if known else None
    return drive.GnssFix(stamp_ns=stamp_ns, position=position, std_m=std_m)


def ros_from_imu(message: drive.ImuSample, _frame: LocalFrame | None) -> Any:
    """Return the Imu of an imu message; it holds no orientation."""
    return ros_message(
        parts.IMU,
        header=header_from(message.stamp_ns, parts.BASE_FRAME),
        orientation=parts.turn_from(0.0),
        orientation_covariance=covariance(3, d0=_ABSENT),
        angular_velocity=parts.vector_from(*message.rate_radps),
        linear_acceleration=parts.vector_from(*message.accel_mps2),
        linear_acceleration_covariance=covariance(3, d0=0.0 if message.tells_force else _ABSENT),
    )


def ros_from_speed(message: drive.SpeedSample, _frame: LocalFrame | None) -> Any:
    """Return the TwistStamped of a speed message."""
    return ros_message(
        parts.TWIST_STAMPED,
        header=header_from(message.stamp_ns, parts.BASE_FRAME),
        twist=parts.twist_from(message.speed_mps, 0.0),
    )


def ros_from_heading(message: drive.HeadingSample, _frame: LocalFrame | None) -> Any:
    """Return the Imu of a heading message; it holds no more than orientation and yaw rate."""
    rate = message.yaw_rate_radps
    return ros_message(
        parts.IMU,
        header=header_from(message.stamp_ns, parts.BASE_FRAME),
        orientation=parts.turn_from(message.yaw_rad),
        angular_velocity=parts.vector_from(0.0, 0.0, rate or 0.0),
        angular_velocity_covariance=covariance(3, d0=_ABSENT if rate is None else 0.0),
        linear_acceleration_covariance=covariance(3, d0=_ABSENT),
    )


def heading_from_ros(ros: Any, stamp_ns: int) -> drive.HeadingSample:
    """Return the heading message of `ros_from_heading`."""
    measured = ros.angular_velocity_covariance[0] != _ABSENT
    rate, yaw = ros.angular_velocity.z if measured else None, parts.yaw_of(ros.orientation)
    return drive.HeadingSample(stamp_ns=stamp_ns, yaw_rad=yaw, yaw_rate_radps=rate)


def ros_from_steering(message: drive.SteeringSample, _frame: LocalFrame | None) -> Any:
    """Return the JointState of a steering message: the angles that are known, by joint."""
    angles = {WHEEL_JOINT: message.steering_wheel_rad, TIRE_JOINT: message.tire_angle_rad}
    known = {name: angle for name, angle in angles.items() if angle is not None}
    return ros_message(
        parts.JOINT_STATE,
        header=header_from(message.stamp_ns, parts.BASE_FRAME),
        name=list(known),
        position=np.array(list(known.values()), dtype=np.float64),
    )


def steering_from_ros(ros: Any, stamp_ns: int) -> drive.SteeringSample:
    """Return the steering message of `ros_from_steering`."""
    angles = dict(zip(ros.name, ros.position.tolist(), strict=True))
    wheel, tire = angles.get(WHEEL_JOINT), angles.get(TIRE_JOINT)
    return drive.SteeringSample(stamp_ns=stamp_ns, steering_wheel_rad=wheel, tire_angle_rad=tire)


def steering_report(message: drive.SteeringSample, _frame: LocalFrame | None) -> Any:
    """Return Autoware's SteeringReport of a steering message, None without a tyre angle."""
    if message.tire_angle_rad is None:
        return None
    return ros_message(
        parts.STEERING_REPORT,
        stamp=parts.time_from(message.stamp_ns),
        steering_tire_angle=parts.within_float32(message.tire_angle_rad),
    )
