"""Commands and motion as Autoware's and Ackermann's messages and Odometry, and back."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from foretwin.contracts import drive
from foretwin.contracts.frames import GeoPoint, LocalFrame, geo_from_local, geo_from_local_yaw
from foretwin.telemetry.ros_messages.parts import (
    ACKERMANN,
    BASE_FRAME,
    CONTROL,
    MAP_FRAME,
    header_from,
    ros_type,
    stamp_ns_of,
    time_from,
    within_float32,
    yaw_of,
)


def command_from_control(ros: Any, *, stamp_ns: int | None = None) -> drive.ControlCommand:
    """Return the command of Autoware's Control (or its older AckermannControlCommand)."""
    return drive.ControlCommand(
        stamp_ns=stamp_ns_of(ros.stamp) if stamp_ns is None else stamp_ns,
        accel_mps2=float(ros.longitudinal.acceleration),
        tire_angle_rad=float(ros.lateral.steering_tire_angle),
    )


def control_from_command(message: drive.ControlCommand, *, speed_mps: float) -> Any:
    """Return Autoware's Control of a command; `speed_mps` is the speed that goes with it.

    Raises ValueError where the angle at the tyres or another number is missing or not finite: what
    obeys must never be given a guess.
    """
    tire, accel = _finite(message)
    stamp = time_from(message.stamp_ns)
    return ros_type(CONTROL)(
        stamp=stamp,
        control_time=stamp,
        lateral=ros_type("autoware_control_msgs/msg/Lateral")(
            stamp=stamp,
            control_time=stamp,
            steering_tire_angle=tire,
            steering_tire_rotation_rate=0.0,
            is_defined_steering_tire_rotation_rate=False,
        ),
        longitudinal=ros_type("autoware_control_msgs/msg/Longitudinal")(
            stamp=stamp,
            control_time=stamp,
            velocity=_finite_number("speed_mps", speed_mps),
            acceleration=accel,
            jerk=0.0,
            is_defined_acceleration=True,
            is_defined_jerk=False,
        ),
    )


def command_from_ackermann(ros: Any, *, stamp_ns: int | None = None) -> drive.ControlCommand:
    """Return the command of an AckermannDriveStamped."""
    return drive.ControlCommand(
        stamp_ns=stamp_ns_of(ros.header.stamp) if stamp_ns is None else stamp_ns,
        accel_mps2=float(ros.drive.acceleration),
        tire_angle_rad=float(ros.drive.steering_angle),
    )


def ackermann_from_command(message: drive.ControlCommand, *, speed_mps: float) -> Any:
    """Return the AckermannDriveStamped of a command; see control_from_command."""
    tire, accel = _finite(message)
    return ros_type(ACKERMANN)(
        header=header_from(message.stamp_ns, BASE_FRAME),
        drive=ros_type("ackermann_msgs/msg/AckermannDrive")(
            steering_angle=tire,
            steering_angle_velocity=0.0,
            speed=_finite_number("speed_mps", speed_mps),
            acceleration=accel,
            jerk=0.0,
        ),
    )


def state_from_odometry(
    ros: Any, frame: LocalFrame, *, vehicle_id: str, stamp_ns: int | None = None
) -> drive.VehicleState:
    """Return the state of an Odometry of base_link in `map`, whose plane is `frame`.

    Standard deviations are those of its covariances, None where they are 0; acceleration is not in
    an Odometry and is named as estimated. Raises ValueError for another frame.
    """
    if ros.header.frame_id.lstrip("/") != MAP_FRAME:
        raise ValueError(f"odometry in frame {ros.header.frame_id!r}; readable: {MAP_FRAME!r}")
    pose, twist = ros.pose.pose, ros.twist.twist
    xy_m = np.array([[pose.position.x, pose.position.y]])
    lat_deg, lon_deg = geo_from_local(frame, xy_m)[0].tolist()
    yaw = geo_from_local_yaw(frame, np.array([yaw_of(pose.orientation)]), xy_m)
    variances = np.asarray(ros.pose.covariance).reshape(6, 6).diagonal()
    return drive.VehicleState(
        vehicle_id=vehicle_id,
        stamp_ns=stamp_ns_of(ros.header.stamp) if stamp_ns is None else stamp_ns,
        position=GeoPoint(lat_deg, lon_deg, frame.origin.alt_m + pose.position.z),
        yaw_rad=float(yaw[0]),
        speed_mps=float(twist.linear.x),
        yaw_rate_radps=float(twist.angular.z),
        accel_mps2=0.0,
        position_std_m=_std(0.5 * float(variances[0] + variances[1])),
        yaw_std_rad=_std(float(variances[5])),
        speed_std_mps=_std(float(ros.twist.covariance[0])),
        estimated=("accel_mps2",),
    )


def _std(variance: float) -> float | None:
    return math.sqrt(variance) if variance > 0.0 else None


def _finite(message: drive.ControlCommand) -> tuple[float, float]:
    return (
        _finite_number("tire_angle_rad", message.tire_angle_rad),
        _finite_number("accel_mps2", message.accel_mps2),
    )


def _finite_number(name: str, value: float | None) -> float:
    if value is None or not math.isfinite(value):
        raise ValueError(f"a command needs a finite {name}; it is {value}")
    return within_float32(value)
