"""What virtual receivers and inertial sensors measure as ROS messages, in frames of their names."""

from __future__ import annotations

from typing import Any

from foretwin.contracts.frames import LocalFrame
from foretwin.contracts.sensed_motion import SensedFix, SensedImu
from foretwin.telemetry.ros_messages.sensors import ros_from_gnss, ros_from_imu


def sensed_fix_from(message: SensedFix, frame: LocalFrame | None = None) -> Any:
    """Return the NavSatFix of a virtual receiver."""
    ros = ros_from_gnss(message, frame)
    ros.position_covariance[8] = message.up_std_m**2
    return _of(message, ros)


def sensed_imu_from(message: SensedImu, frame: LocalFrame | None = None) -> Any:
    """Return the Imu of a virtual inertial sensor, in its own axes."""
    return _of(message, ros_from_imu(message, frame))


def _of(message: SensedFix | SensedImu, ros: Any) -> Any:
    ros.header.frame_id = message.sensor
    return ros
