"""What the stand-in car says over ROS 2: its samples as the messages that a mapping listens to."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

from msgspec.structs import replace

from foretwin.contracts import drive
from foretwin.contracts.frames import LocalFrame
from foretwin.telemetry.ros2.mapping import Mapping
from foretwin.telemetry.ros2.rows import InRow
from foretwin.telemetry.ros_messages import commands, motion, parts, sensors
from foretwin.telemetry.ros_messages.parts import ros_message

_AUTONOMOUS, _DRIVE = 1, 2
"""ControlModeReport.AUTONOMOUS and GearReport.DRIVE."""


class _Said(NamedTuple):
    channel: str
    ros: Callable[[Any, LocalFrame | None], Any]


def _velocity(message: drive.SpeedSample, _frame: LocalFrame | None) -> Any:
    return ros_message(
        parts.VELOCITY_REPORT,
        header=parts.header_from(message.stamp_ns, parts.BASE_FRAME),
        longitudinal_velocity=message.speed_mps,
    )


def _stamped(kind: str, **fields: int) -> Callable[[Any, LocalFrame | None], Any]:
    return lambda message, _: ros_message(kind, stamp=parts.time_from(message.stamp_ns), **fields)


def _control(message: drive.ControlCommand, _frame: LocalFrame | None) -> Any:
    return commands.control_from_command(message, speed_mps=0.0)


_SAID = {
    parts.NAV_SAT_FIX: _Said("gnss", sensors.ros_from_gnss),
    parts.IMU: _Said("imu", sensors.ros_from_imu),
    parts.VELOCITY_REPORT: _Said("speed", _velocity),
    parts.STEERING_REPORT: _Said("steering", sensors.steering_report),
    parts.CONTROL_MODE_REPORT: _Said(
        "status", _stamped(parts.CONTROL_MODE_REPORT, mode=_AUTONOMOUS)
    ),
    parts.GEAR_REPORT: _Said("status", _stamped(parts.GEAR_REPORT, report=_DRIVE)),
    parts.CONTROL: _Said("control", _control),
    parts.TRAJECTORY: _Said("plan", motion.trajectory_from_plan),
}
"""By type, what is said of a channel."""


class RosVoice:
    """Turns samples into CDR bytes for the rows of a mapping that listen to them."""

    def __init__(self, mapping: Mapping, *, steering_ratio: float) -> None:
        self._frame, self._ratio = mapping.map_frame, steering_ratio
        self._rows: dict[str, list[InRow]] = {}
        for row in mapping.inwards:
            said = _SAID.get(row.type)
            if said is not None and not (said.channel == "plan" and self._frame is None):
                self._rows.setdefault(said.channel, []).append(row)

    @property
    def channels(self) -> tuple[str, ...]:
        """What the mapping hears of."""
        return tuple(sorted(self._rows))

    def say(self, channel: str, message: Any) -> Iterator[tuple[InRow, bytes]]:
        """Yield the messages of a sample, with the row of each."""
        if channel in ("steering", "control"):
            message = replace(message, tire_angle_rad=message.steering_wheel_rad / self._ratio)
        for row in self._rows.get(channel, ()):
            ros = _SAID[row.type].ros(message, self._frame)
            yield row, bytes(parts.typestore().serialize_cdr(ros, row.type))
