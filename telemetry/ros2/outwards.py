"""What foretwin says as ROS messages: states, virtual objects, diagnostics, time, commands."""

from __future__ import annotations

from typing import Any, NamedTuple

from foretwin.contracts import drive
from foretwin.contracts.frames import LocalFrame, geo_pose
from foretwin.contracts.simulation import MirrorSample
from foretwin.contracts.towards_vehicle import VehicleCommand
from foretwin.telemetry.ros2.mapping import DIAGNOSTICS, Mapping, OutRow, Source
from foretwin.telemetry.ros_messages.commands import ackermann_from_command, control_from_command
from foretwin.telemetry.ros_messages.motion import odometry_from_state
from foretwin.telemetry.ros_messages.objects import detected_from_users, predicted_from_users
from foretwin.telemetry.ros_messages.parts import (
    CLOCK,
    CONTROL,
    DETECTED_OBJECTS,
    ODOMETRY,
    header_from,
    ros_message,
    time_from,
    typestore,
)

DRIVE_FRAME = "foretwin_drive"
"""The frame of what goes out where the mapping does not place `map`: the drive's own plane."""


class Level(NamedTuple):
    """One line of diagnostics: what it is of, whether all is well, and its numbers."""

    name: str
    level: int
    """0 well, 1 warning, 2 error, as diagnostic_msgs has them."""
    text: str
    values: dict[str, str]


class Outwards:
    """Turns messages of a run into CDR bytes for the rows that carry them."""

    def __init__(self, mapping: Mapping, *, drive_frame: LocalFrame, vehicle_id: str) -> None:
        self._rows = mapping.outwards
        self._map = mapping.map_frame
        self._drive_frame = drive_frame
        self._vehicle_id = vehicle_id

    def rows(self, source: Source) -> list[OutRow]:
        """Return the rows that carry a source."""
        return [row for row in self._rows if row.source == source]

    def warm_up(self) -> None:
        """Make what the first message of each type needs: a tenth of a second nobody shall wait."""
        at = self._drive_frame.origin
        user = drive.RoadUser(
            user_id="none",
            kind="car",
            position=at,
            yaw_rad=0.0,
            speed_mps=0.0,
            length_m=1.0,
            width_m=1.0,
        )
        car = drive.VehicleState(
            vehicle_id="none",
            stamp_ns=0,
            position=at,
            yaw_rad=0.0,
            speed_mps=0.0,
            yaw_rate_radps=0.0,
            accel_mps2=0.0,
        )
        command = VehicleCommand(
            stamp_ns=0, sent_mono_ns=0, tire_angle_rad=0.0, accel_mps2=0.0, speed_mps=0.0
        )
        for row in self._rows:
            match row.source:
                case "state" | "twin":
                    self.state(car)
                case "virtual_objects":
                    self.objects(drive.RoadUsers(stamp_ns=0, users=(user,)), row.type)
                case "diagnostics":
                    self.diagnostics(0, [Level("none", 0, "", {})])
                case "clock":
                    self.clock(0)
                case "vehicle_command":
                    self.command(command, row.type, stamp_ns=0)

    def state(self, message: drive.VehicleState) -> bytes:
        """Return the Odometry of a state."""
        frame = self._map or self._drive_frame
        return _cdr(self._framed(odometry_from_state(message, frame)), ODOMETRY)

    def twin(self, message: MirrorSample) -> bytes:
        """Return the Odometry of the twin."""
        twin, frame = message.twin, self._drive_frame
        alt_m = (self._map or frame).origin.alt_m
        at = geo_pose(frame, twin.x_m, twin.y_m, twin.yaw_rad, alt_m=alt_m)
        return self.state(
            drive.VehicleState(
                vehicle_id=self._vehicle_id,
                stamp_ns=message.stamp_ns,
                position=at.position,
                yaw_rad=at.yaw_rad,
                speed_mps=twin.speed_mps,
                yaw_rate_radps=message.twin_yaw_rate_radps,
                accel_mps2=0.0,
                estimated=("accel_mps2",),
            )
        )

    def objects(self, message: drive.RoadUsers, kind: str) -> bytes:
        """Return DetectedObjects or PredictedObjects."""
        convert = detected_from_users if kind == DETECTED_OBJECTS else predicted_from_users
        return _cdr(self._framed(convert(message, self._map or self._drive_frame)), kind)

    def clock(self, stamp_ns: int) -> bytes:
        """Return a Clock."""
        return _cdr(ros_message(CLOCK, clock=time_from(stamp_ns)), CLOCK)

    def diagnostics(self, stamp_ns: int, levels: list[Level]) -> bytes:
        """Return a DiagnosticArray."""
        pair = "diagnostic_msgs/msg/KeyValue"
        status = [
            ros_message(
                "diagnostic_msgs/msg/DiagnosticStatus",
                level=one.level,
                name=one.name,
                message=one.text,
                hardware_id=self._vehicle_id,
                values=[ros_message(pair, key=key, value=text) for key, text in one.values.items()],
            )
            for one in levels
        ]
        array = ros_message(DIAGNOSTICS, header=header_from(stamp_ns, ""), status=status)
        return _cdr(array, DIAGNOSTICS)

    def command(self, message: VehicleCommand, kind: str, *, stamp_ns: int) -> bytes:
        """Return Control or AckermannDriveStamped; the stamp is when it goes out.

        Raises ValueError for a number that is not finite.
        """
        command = drive.ControlCommand(
            stamp_ns=stamp_ns,
            accel_mps2=message.accel_mps2,
            tire_angle_rad=message.tire_angle_rad,
        )
        convert = control_from_command if kind == CONTROL else ackermann_from_command
        return _cdr(convert(command, speed_mps=message.speed_mps), kind)

    def _framed(self, ros: Any) -> Any:
        if self._map is None:
            ros.header.frame_id = DRIVE_FRAME
        return ros


def _cdr(ros: Any, kind: str) -> bytes:
    return bytes(typestore().serialize_cdr(ros, kind))
