"""Which ROS topics become which channels, and back: one TOML file, checked into a frozen struct.

`[[in]]` rows: topic, type, channel, units and axes that differ from ROS's. `[[out]]` rows: topic,
type, source. `[[virtual]]` rows: road users that do not exist. Whatever a vehicle's software might
obey, that is commands, and any topic outside /foretwin/, counts as towards the vehicle: see
`OutRow.towards_vehicle`.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Literal, NamedTuple

import msgspec

from foretwin.contracts.did_you_mean import one_of
from foretwin.contracts.drive import Vector3
from foretwin.contracts.errors import UserError
from foretwin.contracts.frames import GeoPoint, LocalFrame
from foretwin.contracts.ports import trouble_with_endpoint
from foretwin.contracts.toml_file import parse_toml, toml_text
from foretwin.telemetry.logs.units import ANGLE, SPEED
from foretwin.telemetry.ros2.mirrored import Mirrored
from foretwin.telemetry.ros2.names import Dialect, check_topic, dds_type
from foretwin.telemetry.ros2.safety import CommandLimits
from foretwin.telemetry.ros2.virtual_objects import PlacedObject
from foretwin.telemetry.ros_messages import parts
from foretwin.telemetry.ros_messages.foreign import FOREIGN
from foretwin.telemetry.ros_messages.table import TOPIC_PREFIX as OWN_PREFIX

DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"
AUTOWARE = Path(__file__).with_name("autoware.toml")

Source = Literal["state", "twin", "virtual_objects", "diagnostics", "clock", "vehicle_command"]
_TYPES_OF_SOURCE: dict[Source, tuple[str, ...]] = {
    "state": (parts.ODOMETRY,),
    "twin": (parts.ODOMETRY,),
    "virtual_objects": (parts.PREDICTED_OBJECTS, parts.DETECTED_OBJECTS),
    "diagnostics": (DIAGNOSTICS,),
    "clock": (parts.CLOCK,),
    "vehicle_command": (parts.CONTROL, parts.ACKERMANN),
}
CHANNEL_OF_OTHERS = {parts.TF: "transforms", parts.CLOCK: "clock", parts.LANELET_ROUTE: "route"}
"""Types that are taken in but are no samples of the vehicle's telemetry."""


class MappingError(UserError):
    """A mapping that cannot be used; the text names the file, the line and what would be right."""


class InRow(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One topic that is listened to."""

    topic: str
    """Absolute name of the ROS topic."""
    type: str
    """Its ROS type, such as sensor_msgs/msg/NavSatFix."""
    channel: str
    """What it becomes."""
    stamp: Literal["header", "arrival"] = "header"
    """By whose clock a sample counts."""
    angle_unit: str = "rad"
    """Of steering and commands."""
    left_positive: bool = True
    """Of steering and commands."""
    speed_unit: str = "m/s"
    """Of a speed."""
    axes: Literal["forward_left_up", "forward_right_down"] = "forward_left_up"
    """Of an Imu."""

    def validate(self) -> None:
        """Raise ValueError naming the key at fault."""
        check_topic(self.topic)
        dds_type(self.type)
        known = {kind: how.channels[0] for kind, how in FOREIGN.items()} | CHANNEL_OF_OTHERS
        if self.type not in known:
            raise ValueError(f"type {self.type!r}: readable are {', '.join(sorted(known))}")
        if self.channel != known[self.type]:
            raise ValueError(f"channel {self.channel!r}: {self.type} gives {known[self.type]!r}")
        for name, units in (("angle_unit", ANGLE), ("speed_unit", SPEED)):
            if getattr(self, name) not in units:
                raise ValueError(
                    f"{name} {getattr(self, name)!r}: {one_of(getattr(self, name), units)}"
                )
        angles = self.angle_unit != "rad" or not self.left_positive
        if angles and self.channel not in ("steering", "control"):
            raise ValueError(f"angle_unit, left_positive: not of channel {self.channel!r}")
        if self.speed_unit != "m/s" and self.channel != "speed":
            raise ValueError(f"speed_unit: not of channel {self.channel!r}")
        if self.axes != "forward_left_up" and self.channel != "imu":
            raise ValueError(f"axes: not of channel {self.channel!r}")

    @property
    def is_latched(self) -> bool:
        """Whether ROS says it once and keeps it for who comes later (transient local)."""
        return self.type in (parts.TF, parts.LANELET_ROUTE)

    @property
    def stream(self) -> str:
        """What must come from one topic alone."""
        return FOREIGN[self.type].stream if self.type in FOREIGN else self.type + self.topic


class OutRow(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One topic that is published."""

    topic: str
    """Absolute name of the ROS topic."""
    type: str
    """Its ROS type."""
    source: Source
    """What is told on it."""

    def validate(self) -> None:
        """Raise ValueError naming the key at fault."""
        check_topic(self.topic)
        if self.type not in _TYPES_OF_SOURCE[self.source]:
            raise ValueError(
                f"type {self.type!r}: {self.source} goes out as "
                f"{' or '.join(_TYPES_OF_SOURCE[self.source])}"
            )

    @property
    def towards_vehicle(self) -> bool:
        """Whether software of the vehicle might obey it: a command, or a topic that is not ours."""
        return self.source == "vehicle_command" or not self.topic.startswith(OWN_PREFIX)


class MapPlace(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Where the frame `map` lies: a plane east and north at this point."""

    lat_deg: float
    """Of its zero."""
    lon_deg: float
    """Of its zero."""
    alt_m: float = 0.0
    """Of its zero, above the ellipsoid."""


class TowardsVehicle(CommandLimits, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The configuration's switch and the bounds; the other switch is on the command line."""

    enabled: bool = False
    """The file's switch; the other one is --towards-vehicle."""
    max_objects: int = 64
    """So many virtual road users at most."""


class Mapping(
    msgspec.Struct,
    frozen=True,
    kw_only=True,
    forbid_unknown_fields=True,
    rename={"inwards": "in", "outwards": "out", "map_place": "map", "placed": "virtual"},
):
    """The whole file."""

    dialect: Dialect
    """By what the vehicle's ROS 2 reaches Zenoh."""
    endpoint: str | None = None
    """The vehicle's Zenoh router; None is the run's own, to which the vehicle's side connects."""
    domain: int = 0
    """ROS_DOMAIN_ID, of rmw_zenoh."""
    namespace: str = "/"
    """Of zenoh-bridge-ros2dds."""
    antenna_m: Vector3 | None = None
    """Of the GNSS antenna from base_link: forward, left, up; else from /tf_static."""
    map_place: MapPlace | None = None
    """Where the frame `map` lies; needed for virtual objects towards the vehicle."""
    inwards: tuple[InRow, ...] = ()
    """Topics that are listened to."""
    outwards: tuple[OutRow, ...] = ()
    """Topics that are published."""
    placed: tuple[PlacedObject, ...] = ()
    """Virtual road users that the gateway itself says."""
    mirrored: Mirrored = Mirrored()
    """Vehicles of the mirror that go out among the virtual objects."""
    towards_vehicle: TowardsVehicle = TowardsVehicle()
    """What may go to the vehicle, and within which bounds."""

    @property
    def map_frame(self) -> LocalFrame | None:
        """The plane of `map`, None where the file does not place it."""
        at = self.map_place
        return None if at is None else LocalFrame(GeoPoint(at.lat_deg, at.lon_deg, at.alt_m))


class MappingFile(NamedTuple):
    """A mapping that was read: checked, and as it stands in its file."""

    name: str
    text: str
    mapping: Mapping


def read_mapping(path: Path) -> MappingFile:
    """Read and check a mapping; the name `autoware` is ours for Autoware.

    Raises MappingError or FileNotFoundError, one line.
    """
    if str(path) == "autoware":
        path = AUTOWARE
    text = toml_text(path, "ROS 2 mapping", error=MappingError)
    return MappingFile(str(path), text, parse_mapping(text, name=str(path)))


def parse_mapping(text: str, *, name: str) -> Mapping:
    """Return the mapping of a TOML text; `name` is the file in errors. Raises MappingError."""
    file = parse_toml(text, name, error=MappingError)
    mapping = file.convert(Mapping)
    try:
        mapping.towards_vehicle.validate()
        _check_head(mapping)
        _check_mirrored(mapping)
    except ValueError as error:
        raise file.wrong(error) from error
    seen: dict[str, str] = {}
    tables: tuple[tuple[str, tuple[InRow | OutRow | PlacedObject, ...]], ...] = (
        ("in", mapping.inwards),
        ("out", mapping.outwards),
        ("virtual", mapping.placed),
    )
    for header, rows in tables:
        for index, row in enumerate(rows):
            try:
                row.validate()
                _check_alone(row, seen, mapping)
            except ValueError as error:
                raise file.at((header, index), f"[[{header}]]: {error}") from error
    return mapping


def listening_only(mapping: Mapping) -> Mapping:
    """Return a mapping by which nothing goes out."""
    return msgspec.structs.replace(
        mapping, outwards=(), placed=(), mirrored=Mirrored(), towards_vehicle=TowardsVehicle()
    )


def _check_head(mapping: Mapping) -> None:
    if not 0 <= mapping.domain <= 232:
        raise ValueError(f"domain {mapping.domain}: 0 to 232")
    if mapping.endpoint is not None and (trouble := trouble_with_endpoint(mapping.endpoint)):
        raise ValueError(f"endpoint {mapping.endpoint!r}: {trouble}")
    at = mapping.map_place
    if at is not None and not (abs(at.lat_deg) < 90.0 and abs(at.lon_deg) <= 180.0):
        raise ValueError(f"map at {at.lat_deg}, {at.lon_deg}: degrees of latitude and longitude")
    if mapping.antenna_m is not None and not all(map(math.isfinite, mapping.antenna_m)):
        raise ValueError(f"antenna_m {mapping.antenna_m}: three finite numbers")


def _check_mirrored(mapping: Mapping) -> None:
    rows = [row for row in mapping.outwards if row.source == "virtual_objects"]
    if mapping.mirrored and not rows:
        raise ValueError(
            '[mirrored]: without an [[out]] of source "virtual_objects" it goes nowhere'
        )
    if mapping.mirrored.own_twin and all(row.towards_vehicle for row in rows):
        raise ValueError(
            f"[mirrored] own_twin: needs a topic below {OWN_PREFIX}; it fills the car's own place, "
            "and never goes towards the vehicle"
        )


def _check_alone(
    row: InRow | OutRow | PlacedObject, seen: dict[str, str], mapping: Mapping
) -> None:
    """Refuse two topics for one stream, what stands twice, and objects that cannot go out."""
    if isinstance(row, PlacedObject):
        if not any(one.source == "virtual_objects" for one in mapping.outwards):
            raise ValueError('without an [[out]] of source "virtual_objects" it goes nowhere')
        keys, first = {f"virtual {row.user_id}": f"id {row.user_id!r}"}, row.user_id
    elif isinstance(row, InRow):
        keys, first = (
            {f"in {row.topic}": f"topic {row.topic}", row.stream: f"stream {row.stream}"},
            row.topic,
        )
    else:
        first = row.topic
        keys = {f"out {row.topic}": f"topic {row.topic}"}
        if row.source == "virtual_objects" and row.towards_vehicle and mapping.map_place is None:
            raise ValueError("virtual objects towards the vehicle need [map] lat_deg, lon_deg")
    for key, what in keys.items():
        if key in seen:
            raise ValueError(f"{what} stands twice; first: {seen[key]}")
        seen[key] = first
