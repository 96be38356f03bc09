"""ROS messages of a vehicle as samples of its telemetry; pure, counts what it cannot use."""

from __future__ import annotations

from collections import Counter
from typing import Any, Literal, NamedTuple

import msgspec

from foretwin.contracts import drive
from foretwin.contracts.anchor import Anchor
from foretwin.contracts.bounds import MOST_BYTES, MOST_ROS_BYTES
from foretwin.contracts.foreign_bus import Arrived
from foretwin.contracts.frames import GeoPoint
from foretwin.contracts.guard import Refused, admit
from foretwin.contracts.numbering import Numberings
from foretwin.contracts.point_cloud import NO_MOUNTS, Mounts, PointCloud, base_from_mount_cloud
from foretwin.telemetry.anchored import world_from_lot_message
from foretwin.telemetry.logs.mountings import NOT_UPRIGHT, GravitySeen
from foretwin.telemetry.ros2.attachment import unpack
from foretwin.telemetry.ros2.declared_units import in_our_units
from foretwin.telemetry.ros2.injected import Injected
from foretwin.telemetry.ros2.lights import LightExchange
from foretwin.telemetry.ros2.mapping import Mapping
from foretwin.telemetry.ros2.merged_objects import HeardObjects
from foretwin.telemetry.ros2.names import bridge_key, parse_rmw_key, rmw_any_type_key
from foretwin.telemetry.ros2.rows import REAL_CLOUD, InRow
from foretwin.telemetry.ros_messages.ackermann import (
    NO_ACCELERATION,
    AckermannCommands,
    AckermannTarget,
)
from foretwin.telemetry.ros_messages.clouds import cloud_of
from foretwin.telemetry.ros_messages.foreign import FOREIGN, UnusableError, channel_of, stamp_of
from foretwin.telemetry.ros_messages.motion import route_from_lanelets
from foretwin.telemetry.ros_messages.odometry import of_base
from foretwin.telemetry.ros_messages.parts import (
    BASE_FRAME,
    CLOCK,
    LANELET_ROUTE,
    ODOMETRY,
    POINT_CLOUD2,
    STRING,
    TF,
    typestore,
)
from foretwin.telemetry.ros_messages.status import StatusJoiner, StatusPart
from foretwin.telemetry.ros_messages.transforms import TransformTree

Samples = list[tuple[str, msgspec.Struct]]
Measure = Literal["tire_angle_rad", "speed_mps"]
MEASURED_WITHIN_NS = 500_000_000
"""What was measured longer ago says nothing of now."""


class Wanted(NamedTuple):
    """A key expression, and whether what was said on it before counts as well."""

    key: str
    history: bool
    bulky: bool = False
    """Clouds, which wait apart: few, and the newest."""


class Inwards:
    """Turns what arrives into samples; with an `anchor`, from the car's lot into the World.

    `counts` holds samples by channel, `unused` what was left out by topic and reason.
    """

    def __init__(
        self,
        mapping: Mapping,
        anchor: Anchor | None = None,
        mounts: Mounts = NO_MOUNTS,
    ) -> None:
        self._mapping, self.anchor, self._mounts = mapping, anchor, mounts
        self._rows = {row.topic: row for row in mapping.inwards}
        self._by_bridge_key = {
            bridge_key(row.topic, namespace=mapping.namespace): row for row in mapping.inwards
        }
        self._joiner, self._commands = StatusJoiner(), AckermannCommands()
        self._transforms, self._gravity = TransformTree(), GravitySeen()
        self._antenna_frame: str | None = None
        self.counts: Counter[str] = Counter()
        self.unused: Counter[str] = Counter()
        self._numbers = Numberings()
        self.injected = Injected()
        """What the car was shown: not taken for real where it says so itself."""
        self.lights = LightExchange(mapping.lights)
        """Which lights go out and come in, under their groups' names in the World."""
        self.heard_mono_ns = 0
        """When the newest sample of the car came."""
        self.fix: GeoPoint | None = None
        """The car's newest position, as it came."""
        self.first_stamp_ns: int | None = None
        self._measured: dict[Measure, tuple[float, int]] = {}
        """The newest value of each, and when it came."""
        self.objects = HeardObjects(None)
        """What the newest road users came in."""
        self.route: drive.RouteToGoal | None = None
        """The newest route of the vehicle's own driving stack."""

    def key_expressions(self) -> list[Wanted]:
        """Return what to subscribe to; of rmw_zenoh with any type and hash."""
        if self._mapping.dialect == "ros2dds":
            return [
                Wanted(key, row.is_latched, row.type == POINT_CLOUD2)
                for key, row in self._by_bridge_key.items()
            ]
        domain = self._mapping.domain
        return [
            Wanted(rmw_any_type_key(topic, domain=domain), row.is_latched, row.type == POINT_CLOUD2)
            for topic, row in self._rows.items()
        ]

    @property
    def lost(self) -> Counter[str]:
        """By topic, samples that the sequence numbers of rmw_zenoh say went missing."""
        return +self._numbers.missing

    def measured(self, what: Measure, *, now_ns: int) -> float | None:
        """Return what the car measured last, None where that says nothing of now."""
        value, at_ns = self._measured.get(what, (None, 0))
        return value if now_ns - at_ns <= MEASURED_WITHIN_NS else None

    @property
    def channels(self) -> tuple[str, ...]:
        """The channels of telemetry that the mapping feeds."""
        return tuple(sorted({row.channel for row in self._rows.values() if row.type in FOREIGN}))

    @property
    def antenna_m(self) -> drive.Vector3 | None:
        """The antenna's place in base_link, from the mapping or from the transforms."""
        if self._mapping.antenna_m is not None or self._antenna_frame is None:
            return self._mapping.antenna_m
        return self._transforms.place_of(self._antenna_frame, within=BASE_FRAME)

    @property
    def awaits_antenna(self) -> bool:
        """Whether transforms that have not come yet may still tell the antenna's place."""
        return self.antenna_m is None and any(row.type == TF for row in self._rows.values())

    def take(self, arrived: Arrived) -> Samples:
        """Return the samples of one message, none where it cannot be used; never raises."""
        row, why = self._row_of(arrived.key)
        if row is None:
            self.unused[why] += 1
            return []
        if arrived.attachment is not None:
            self._follow(row.topic, arrived.attachment)
        most = MOST_BYTES if row.type == POINT_CLOUD2 else MOST_ROS_BYTES
        if len(arrived.payload) > most:
            self.unused[f"{row.topic}: more than {most} bytes"] += 1
            return []
        try:
            ros = typestore().deserialize_cdr(arrived.payload, row.type)
        except Exception:  # whatever rosbags raises over broken bytes, or those of another type
            self.unused[f"{row.topic}: unreadable as {row.type}"] += 1
            return []
        try:
            return self._samples(row, ros, arrived)
        except UnusableError as reason:
            self.unused[f"{row.topic}: {reason}"] += 1
        except Refused as refused:
            self.unused[f"{row.topic}: {refused.reason}"] += 1
        except Exception as error:  # no message may end the gateway
            # Its text may differ each time, and this must stay small.
            self.unused[f"{row.topic}: {type(error).__name__}"] += 1
        return []

    def _row_of(self, key: str) -> tuple[InRow | None, str]:
        if self._mapping.dialect == "ros2dds":
            return self._by_bridge_key.get(key), f"{key}: not mapped"
        try:
            found = parse_rmw_key(key)
        except ValueError:
            return None, f"{key}: no key of rmw_zenoh"
        row = self._rows.get(found.topic)
        if row is not None and row.type != found.kind:
            return None, f"{found.topic}: type {found.kind} instead of {row.type}"
        return row, f"{found.topic}: not mapped"

    def _follow(self, topic: str, attached: bytes) -> None:
        try:
            attachment = unpack(attached)
        except ValueError:
            self.unused[f"{topic}: attachment not understood"] += 1
            return
        self._numbers.take(topic, attachment.seq, sender=attachment.gid.hex())

    def _samples(self, row: InRow, ros: Any, arrived: Arrived) -> Samples:
        if row.type == TF:
            self._transforms.add(ros)
            return []
        if row.type == CLOCK:
            return []
        if row.type == LANELET_ROUTE:
            route = route_from_lanelets(ros, self._mapping.map_frame)
            self.route = world_from_lot_message(self.anchor, route)
            return [("route", self.route)]
        if row.type == STRING:
            try:
                states = self.lights.from_spat(ros.data, arrived.received_wall_ns)
            except ValueError as error:
                raise UnusableError("no SPAT as JSON") from error
            return [one for state in states for one in self._light(state, row, arrived)]
        stamp_ns = arrived.received_wall_ns
        if row.stamp == "header":
            stamp_ns = stamp_of(ros) or stamp_ns
        if row.type == POINT_CLOUD2:
            return [(REAL_CLOUD, self._cloud(row, ros, stamp_ns))]
        how = FOREIGN[row.type]
        if "objects" in how.channels:
            self.objects = HeardObjects(ros)
        if "gnss" in how.channels:
            self._antenna_frame = str(ros.header.frame_id)
        if row.type == ODOMETRY:
            ros = of_base(ros, self._transforms)
        samples: Samples = []
        for message in how.read(ros, stamp_ns, self._mapping.map_frame):
            if isinstance(message, StatusPart):
                message = self._joiner.join(message)
            if isinstance(message, AckermannTarget):
                command = self._commands.command(message)
                if command is None:
                    raise UnusableError(NO_ACCELERATION)
                message = command
            if isinstance(message, drive.SignalState):
                samples += self._light(self.lights.in_world(message), row, arrived)
                continue
            message = in_our_units(message, row)
            if isinstance(message, drive.ImuSample):
                message = self._in_the_cars_axes(message, row, str(ros.header.frame_id))
            message, left_out = admit(message, where=row.topic)
            if isinstance(message, drive.RoadUsers):
                message = self._without_ours(message, row)
            if left_out:
                self.unused[f"{row.topic}: road users that cannot be"] += left_out
            self._note(message, arrived)
            channel = channel_of(message)
            samples.append((channel, world_from_lot_message(self.anchor, message)))
            self.counts[channel] += 1
        return samples

    def _in_the_cars_axes(self, sample: drive.ImuSample, row: InRow, frame: str) -> drive.ImuSample:
        # Axes that the mapping declares are those of the car already.
        declared = row.axes != "forward_left_up"
        turn = None if declared else self._transforms.turn_of(frame, within=BASE_FRAME)
        mounting = self._gravity.mounting(sample, turn)
        if not mounting.upright:
            raise UnusableError(NOT_UPRIGHT)
        return mounting.in_the_cars_axes(sample)

    def _cloud(self, row: InRow, ros: Any, stamp_ns: int) -> PointCloud:
        if (mount := self._mounts.get(row.sensor)) is None:
            raise UnusableError(f"no sensor {row.sensor!r} in the drive")
        cloud = cloud_of(ros, stamp_ns, sensor=row.sensor)
        if self.injected.is_shown_cloud(cloud):
            raise UnusableError("a cloud that we have sent")
        cloud = world_from_lot_message(self.anchor, cloud)
        self.counts[REAL_CLOUD] += 1
        if str(ros.header.frame_id).lstrip("/") == BASE_FRAME:
            return cloud
        return msgspec.structs.replace(cloud, points=base_from_mount_cloud(cloud.points, mount))

    def _light(self, heard: drive.SignalState, row: InRow, arrived: Arrived) -> Samples:
        """Return a light that was heard, unless it only says again what was said of it."""
        if self.lights.is_echo(heard, mono_ns=arrived.received_mono_ns):
            self.unused[f"{row.topic}: lights that show what we have said of them"] += 1
            return []
        message, _ = admit(heard, where=row.topic)
        if row.type != STRING:  # V2X is no word of the car
            self._note(message, arrived)
        self.counts["signals"] += 1
        return [("signals", message)]

    def _without_ours(self, message: drive.RoadUsers, row: InRow) -> drive.RoadUsers:
        real = self.injected.without(message)
        if len(message.users) > len(real.users):
            ours = {one.user_id for one in message.users} - {one.user_id for one in real.users}
            self.unused[f"{row.topic}: road users that we have shown it"] += len(ours)
            self.objects = self.objects._replace(echoes=frozenset(ours))
        return real

    def _note(self, message: msgspec.Struct, arrived: Arrived) -> None:
        self.heard_mono_ns = arrived.received_mono_ns
        if self.first_stamp_ns is None:
            self.first_stamp_ns = message.stamp_ns  # type: ignore[attr-defined]
        if isinstance(message, drive.GnssFix):
            self.fix = message.position
        if isinstance(message, drive.SpeedSample):
            self._commands.note(message)
            self._measured["speed_mps"] = message.speed_mps, arrived.received_mono_ns
        if isinstance(message, drive.SteeringSample) and message.tire_angle_rad is not None:
            self._measured["tire_angle_rad"] = message.tire_angle_rad, arrived.received_mono_ns
