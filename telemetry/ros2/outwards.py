"""What foretwin says as ROS messages: states, virtual objects, diagnostics, time, commands."""

from __future__ import annotations

from typing import Any, NamedTuple

import msgspec

from foretwin.contracts import drive
from foretwin.contracts.anchor import Anchor
from foretwin.contracts.frames import LocalFrame, geo_pose
from foretwin.contracts.point_cloud import NO_MOUNTS, Mounts, PointCloud, mount_from_base_cloud
from foretwin.contracts.radar_list import RadarList
from foretwin.contracts.simulation import MirrorSample
from foretwin.contracts.towards_vehicle import VehicleCommand
from foretwin.telemetry.anchored import Message, lot_from_world_message
from foretwin.telemetry.ros2.mapping import Mapping
from foretwin.telemetry.ros2.merged_objects import MergedList
from foretwin.telemetry.ros2.rows import DIAGNOSTICS, OutRow, Source
from foretwin.telemetry.ros_messages import parts
from foretwin.telemetry.ros_messages.clouds import cloud_from
from foretwin.telemetry.ros_messages.commands import ackermann_from_command, control_from_command
from foretwin.telemetry.ros_messages.motion import odometry_from_state
from foretwin.telemetry.ros_messages.objects import CERTAIN, FROM_USERS, joined
from foretwin.telemetry.ros_messages.parts import ros_message
from foretwin.telemetry.ros_messages.radars import radar_scan_from

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
    """Turns messages of a run into CDR bytes for the rows that carry them.

    With an `anchor` states, twins and objects, which are in the World, go out on the car's lot.
    """

    def __init__(
        self,
        mapping: Mapping,
        *,
        drive_frame: LocalFrame,
        vehicle_id: str,
        anchor: Anchor | None = None,
        mounts: Mounts = NO_MOUNTS,
    ) -> None:
        self._rows, self._mounts = mapping.outwards, mounts
        self._map = mapping.map_frame
        self._drive_frame, self._anchor = drive_frame, anchor
        self._car_frame = drive_frame if anchor is None else anchor.lot.frame
        self._vehicle_id = vehicle_id
        ground = self._map or drive_frame if anchor is None else anchor.world.frame
        self.ground_alt_m = ground.origin.alt_m
        """Of the World, where nothing says more."""

    def rows(self, source: Source, sensor: str = "") -> list[OutRow]:
        """Return the rows that carry a source, of what sensors measure those of one sensor."""
        return [row for row in self._rows if row.source == source and row.sensor == sensor]

    def warm_up(self) -> None:
        """Compile the types that go out: tens of milliseconds, which no first message waits for."""
        for row in self._rows:
            _cdr(ros_message(row.type), row.type)

    def on_lot(self, message: Message) -> Message:
        """Return where the car is what is said in the World."""
        return lot_from_world_message(self._anchor, message)

    def state(self, message: drive.VehicleState) -> bytes:
        """Return the Odometry of a state."""
        ros = odometry_from_state(self.on_lot(message), self._map or self._car_frame)
        return _cdr(self._framed(ros), parts.ODOMETRY)

    def twin(self, message: MirrorSample) -> bytes:
        """Return the Odometry of the twin."""
        twin, frame = message.twin, self._drive_frame
        at = geo_pose(frame, twin.x_m, twin.y_m, twin.yaw_rad, alt_m=self.ground_alt_m)
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
        """Return DetectedObjects, TrackedObjects or PredictedObjects."""
        frame = self._map or self._car_frame
        ros = FROM_USERS[kind](self._users(message, frame), frame, CERTAIN)
        return _cdr(self._framed(ros), kind)

    def merged(self, one: MergedList, kind: str) -> bytes:
        """Return the car's own list, of the type `kind`, with what is added to it."""
        assert self._map is not None  # the mapping asks for it
        ours = FROM_USERS[kind](self._users(one.virtual, self._map), self._map, one.spread)
        return _cdr(joined(one.real.ros, ours, without=one.without), kind)

    def rows_of(self, one: PointCloud | RadarList) -> list[OutRow]:
        """Return the rows that carry what a sensor has measured."""
        source: Source = "point_cloud" if isinstance(one, PointCloud) else "radar_list"
        return self.rows(source, one.sensor)

    def measured(self, message: PointCloud | RadarList, row: OutRow) -> bytes:
        """Return a PointCloud2 or a RadarScan; raises KeyError where it is not known where the
        sensor of a cloud sits."""
        if isinstance(message, RadarList):
            return _cdr(radar_scan_from(self.on_lot(message), frame_id=row.frame), row.type)
        if row.frame:
            points = mount_from_base_cloud(message.points, self._mounts[row.sensor])
            message = msgspec.structs.replace(message, points=points)
        frame_id = row.frame or parts.BASE_FRAME
        ros = cloud_from(self.on_lot(message), layout=row.layout, frame_id=frame_id)
        return _cdr(ros, row.type)

    def clock(self, stamp_ns: int) -> bytes:
        """Return a Clock."""
        return _cdr(ros_message(parts.CLOCK, clock=parts.time_from(stamp_ns)), parts.CLOCK)

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
        array = ros_message(DIAGNOSTICS, header=parts.header_from(stamp_ns, ""), status=status)
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
        convert = control_from_command if kind == parts.CONTROL else ackermann_from_command
        return _cdr(convert(command, speed_mps=message.speed_mps), kind)

    def _users(self, message: drive.RoadUsers, frame: LocalFrame) -> drive.RoadUsers:
        """Return where the car is who is there, on the ground of `frame` whose altitude is not
        known."""
        ground_m = frame.origin.alt_m
        users = tuple(
            one if said.position.alt_m else _at_altitude(one, ground_m)
            for said, one in zip(message.users, self.on_lot(message).users, strict=True)
        )
        return msgspec.structs.replace(message, users=users)

    def _framed(self, ros: Any) -> Any:
        if self._map is None:
            ros.header.frame_id = DRIVE_FRAME
        return ros


def _at_altitude(user: drive.RoadUser, alt_m: float) -> drive.RoadUser:
    position = msgspec.structs.replace(user.position, alt_m=alt_m)
    return msgspec.structs.replace(user, position=position)


def _cdr(ros: Any, kind: str) -> bytes:
    return bytes(parts.typestore().serialize_cdr(ros, kind))
