"""Commands as Autoware's and Ackermann's messages."""

from __future__ import annotations

import math
from typing import Any

from foretwin.contracts import drive
from foretwin.contracts.frames import LocalFrame
from foretwin.telemetry.ros_messages import parts
from foretwin.telemetry.ros_messages.ackermann import towards
from foretwin.telemetry.ros_messages.parts import ros_message, within_float32


def control_from_command(message: drive.ControlCommand, *, speed_mps: float) -> Any:
    """Return Autoware's Control of a command; `speed_mps` is the speed that goes with it.

    Raises ValueError where the angle at the tyres or another number is missing or not finite: what
    obeys must never be given a guess.
    """
    tire, accel, speed = _finite(message, speed_mps)
    stamp = parts.time_from(message.stamp_ns)
    times = {"stamp": stamp, "control_time": stamp}
    return ros_message(
        parts.CONTROL,
        **times,
        lateral=ros_message("autoware_control_msgs/msg/Lateral", **times, steering_tire_angle=tire),
        longitudinal=ros_message(
            "autoware_control_msgs/msg/Longitudinal",
            **times,
            velocity=speed,
            acceleration=accel,
            is_defined_acceleration=True,
        ),
    )


def ackermann_from_command(message: drive.ControlCommand, *, speed_mps: float) -> Any:
    """Return the AckermannDriveStamped of a command to a car that drives forwards.

    Its acceleration is a magnitude, and the speed lies in its direction: see `ackermann.towards`.
    Raises as control_from_command does.
    """
    tire, accel, speed = _finite(message, speed_mps)
    return _ackermann(message.stamp_ns, tire, *towards(accel, speed))


def ackermann_view(message: drive.ControlCommand, _frame: LocalFrame | None) -> Any:
    """Return the AckermannDriveStamped to look at.

    NaN where no tyre angle is commanded, and for the speed but in braking: a command tells none.
    """
    tire = math.nan if message.tire_angle_rad is None else message.tire_angle_rad
    speed, limit = towards(within_float32(message.accel_mps2), math.nan)
    return _ackermann(message.stamp_ns, within_float32(tire), speed, limit)


def _ackermann(stamp_ns: int, tire: float, speed: float, limit: float) -> Any:
    return ros_message(
        parts.ACKERMANN,
        header=parts.header_from(stamp_ns, parts.BASE_FRAME),
        drive=ros_message(
            "ackermann_msgs/msg/AckermannDrive",
            steering_angle=tire,
            speed=speed,
            acceleration=limit,
        ),
    )


def _finite(message: drive.ControlCommand, speed_mps: float) -> tuple[float, float, float]:
    """Return tyre angle, acceleration and speed as 32 bits hold them; raises ValueError."""
    numbers = {
        "tire_angle_rad": message.tire_angle_rad,
        "accel_mps2": message.accel_mps2,
        "speed_mps": speed_mps,
    }
    for name, value in numbers.items():
        if value is None or not math.isfinite(value):
            raise ValueError(f"a command needs a finite {name}; it is {value}")
    tire, accel, speed = (within_float32(value) for value in numbers.values() if value is not None)
    return tire, accel, speed
