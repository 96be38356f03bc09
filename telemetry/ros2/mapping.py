"""Which ROS topics become which channels, and back: one TOML file, checked into a frozen struct.

`[[in]]` rows: topic, type, channel, units and axes that differ from ROS's. `[[out]]` rows: topic,
type, source. `[[virtual]]` rows: road users that do not exist. `[[light]]` rows: by which numbers
others know the World's lights. Whatever a vehicle's software might
obey, that is commands, and any topic outside /foretwin/, counts as towards the vehicle: see
`OutRow.towards_vehicle`.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple

import msgspec

from foretwin.contracts.drive import Vector3
from foretwin.contracts.errors import UserError
from foretwin.contracts.frames import GeoPoint, LocalFrame
from foretwin.contracts.ports import trouble_with_endpoint
from foretwin.contracts.toml_file import parse_toml, toml_text
from foretwin.telemetry.mixed.merge import MergeRules
from foretwin.telemetry.ros2.lights import LightIds
from foretwin.telemetry.ros2.mirrored import Mirrored
from foretwin.telemetry.ros2.names import Dialect
from foretwin.telemetry.ros2.rows import (
    INJECTS,
    OF_SENSORS,
    SHOWS_LIGHTS,
    SHOWS_VIRTUAL,
    InRow,
    OutRow,
    Source,
)
from foretwin.telemetry.ros2.safety import CommandLimits
from foretwin.telemetry.ros2.virtual_objects import PlacedObject
from foretwin.telemetry.ros_messages.table import TOPIC_PREFIX as OWN_PREFIX

AUTOWARE = Path(__file__).with_name("autoware.toml")


class MappingError(UserError):
    """A mapping that cannot be used; the text names the file, the line and what would be right."""


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
    rename={
        "inwards": "in",
        "outwards": "out",
        "map_place": "map",
        "placed": "virtual",
        "lights": "light",
    },
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
    lights: tuple[LightIds, ...] = ()
    """By which numbers others know the World's lights."""
    mirrored: Mirrored = Mirrored()
    """Vehicles of the mirror that go out among the virtual objects."""
    merged: MergeRules = MergeRules()
    """How virtual objects are merged with those that the car really sees."""
    towards_vehicle: TowardsVehicle = TowardsVehicle()
    """What may go to the vehicle, and within which bounds."""

    @property
    def map_frame(self) -> LocalFrame | None:
        """The plane of `map`, None where the file does not place it."""
        at = self.map_place
        return None if at is None else LocalFrame(GeoPoint(at.lat_deg, at.lon_deg, at.alt_m))

    def announced(self, *, towards_vehicle: bool) -> list[InRow | OutRow]:
        """Return the topics that ROS is told of, of those towards the vehicle only by request."""
        return [
            *self.inwards,
            *(row for row in self.outwards if towards_vehicle or not row.towards_vehicle),
        ]

    @property
    def sources(self) -> frozenset[Source]:
        """What goes out on some topic."""
        return frozenset(row.source for row in self.outwards)

    @property
    def vehicle_channels(self) -> tuple[str, ...]:
        """Channels of the vehicle's estimate from which something goes out."""
        wanted = self.sources & {"state", "clock", "merged_objects"}
        return ("state",) if wanted or self.placed or self.mirrored else ()

    @property
    def run_channels(self) -> tuple[str, ...]:
        """Channels of the run, orders apart, from which something goes out."""
        sources = self.sources
        return (
            *(("mirror",) if "twin" in sources or self.mirrored else ()),
            *(("virtual_objects", "virtual_traffic") if sources & set(INJECTS) else ()),
            *(one for one in OF_SENSORS if one in sources),
            *(("lights",) if sources & set(SHOWS_LIGHTS) else ()),
            *(("event", "gap_alarm", "verdict") if "diagnostics" in sources else ()),
        )


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
        mapping.merged.validate()
        _check_head(mapping)
        _check_mirrored(mapping)
    except ValueError as error:
        raise file.wrong(error) from error
    seen: dict[str, str] = {}
    tables: tuple[tuple[str, tuple[_Row, ...]], ...] = (
        ("in", mapping.inwards),
        ("out", mapping.outwards),
        ("virtual", mapping.placed),
        ("light", mapping.lights),
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
    rows = [row for row in mapping.outwards if row.source in SHOWS_VIRTUAL]
    if mapping.mirrored and not rows:
        raise ValueError(
            '[mirrored]: without an [[out]] of source "virtual_objects" it goes nowhere'
        )
    if mapping.mirrored.own_twin and all(row.towards_vehicle for row in rows):
        raise ValueError(
            f"[mirrored] own_twin: needs a topic below {OWN_PREFIX}; it fills the car's own place, "
            "and never goes towards the vehicle"
        )


_Row = InRow | OutRow | PlacedObject | LightIds


def _check_alone(row: _Row, seen: dict[str, str], mapping: Mapping) -> None:
    """Refuse two topics for one stream, what stands twice, and objects that cannot go out."""
    if isinstance(row, PlacedObject):
        if not any(one.source in SHOWS_VIRTUAL for one in mapping.outwards):
            raise ValueError('without an [[out]] of source "virtual_objects" it goes nowhere')
        keys, first = {f"virtual {row.user_id}": f"id {row.user_id!r}"}, row.user_id
    elif isinstance(row, LightIds):
        keys, first = {f"light {name}": name for name in row.known_as}, row.group
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
        _check_no_echo(row, mapping)
    for key, what in keys.items():
        if key in seen:
            raise ValueError(f"{what} stands twice; first: {seen[key]}")
        seen[key] = first


def _check_no_echo(row: OutRow, mapping: Mapping) -> None:
    """Refuse what would come back as real, and a merged list of which the real half lacks."""
    shows = row.source in (*INJECTS, *SHOWS_LIGHTS)
    if shows and any(row.topic == one.topic for one in mapping.inwards):
        raise ValueError(f"topic {row.topic} is listened to: what goes out would come back as real")
    if row.source in SHOWS_LIGHTS and not mapping.lights:
        raise ValueError("lights go out by the numbers of [[light]] rows: foretwin lights")
    if row.source != "merged_objects":
        return
    if not any(one.type == row.type for one in mapping.inwards):
        raise ValueError(f"merged objects need an [[in]] of their type, {row.type}: the real ones")
    if mapping.map_place is None:
        raise ValueError("merged objects need [map] lat_deg, lon_deg")
