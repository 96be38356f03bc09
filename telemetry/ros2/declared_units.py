"""The units and axes that a row of a mapping declares, where a car departs from REP-103."""

from __future__ import annotations

import msgspec

from foretwin.contracts import drive
from foretwin.telemetry.logs.units import ANGLE, SPEED
from foretwin.telemetry.ros2.rows import InRow


def in_our_units(message: msgspec.Struct, row: InRow) -> msgspec.Struct:
    """Return a sample in radians, metres a second and axes forward, left and up."""
    match message:
        case drive.SteeringSample() | drive.ControlCommand():
            factor = ANGLE[row.angle_unit] * (1.0 if row.left_positive else -1.0)
            angle = message.tire_angle_rad
            if angle is None:
                return message
            return msgspec.structs.replace(message, tire_angle_rad=factor * angle)
        case drive.SpeedSample():
            speed = message.speed_mps * SPEED[row.speed_unit]
            return msgspec.structs.replace(message, speed_mps=speed)
        case drive.ImuSample() if row.axes == "forward_right_down":
            a, w = message.accel_mps2, message.rate_radps
            return msgspec.structs.replace(
                message, accel_mps2=(a[0], -a[1], -a[2]), rate_radps=(w[0], -w[1], -w[2])
            )
    return message
