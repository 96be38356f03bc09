"""The World: one junction and its surroundings in metres, as every room sees it.

All geometry is in the World's own local frame (origin at the junction's centre). Every value
that a map can lack says whether it was tagged in the map, inferred from it, or a default.
"""

from __future__ import annotations

from typing import Literal

import msgspec

from contracts.arrays import Array
from contracts.frames import LocalFrame

Provenance = Literal["tagged", "inferred", "default"]
JunctionKind = Literal[
    "roundabout", "circular", "mini_roundabout", "crossing", "t_junction", "staggered", "merge",
    "other",
]  # fmt: skip
Control = Literal["signals", "stop", "all_way_stop", "give_way", "roundabout", "uncontrolled"]
DrivingSide = Literal["right", "left"]
LaneKind = Literal["driving", "bus", "bicycle", "parking", "tram"]
Turn = Literal["straight", "left", "right", "u_turn"]
LineControl = Literal["signal", "stop", "give_way", "none"]

ATTRIBUTION = "© OpenStreetMap contributors"
"""Stands in every picture, report and export made from OpenStreetMap data."""

DRAWN_GENERATOR = "foretwin draw_town"
"""How the generator of a map drawn for foretwin begins."""
DRAWN_ATTRIBUTION = "drawn for foretwin, an invented town"
"""Stands in OpenStreetMap's place where the map is none of theirs."""


class Quantity(msgspec.Struct, frozen=True):
    """A number and where it came from."""

    value: float
    source: Provenance


class Choice(msgspec.Struct, frozen=True):
    """A word and where it came from."""

    value: str
    source: Provenance


class IntersectionSummary(msgspec.Struct, frozen=True, kw_only=True):
    """One junction as a driver sees it; `arms` counts the roads that meet there."""

    id: str
    kind: JunctionKind
    lat: float
    lon: float
    arms: int
    control: Control
    driving_side: DrivingSide
    osm_nodes: tuple[int, ...]
    name: str = ""


class Arm(msgspec.Struct, frozen=True, kw_only=True):
    """One road that meets the junction; `bearing_rad` counter-clockwise from east, outward."""

    id: str
    name: str
    osm_ways: tuple[int, ...]
    bearing_rad: float
    lanes_in: int
    lanes_out: int


class Lane(msgspec.Struct, frozen=True, kw_only=True):
    """One lane; `centerline` (N, 2) in driving direction, neighbours as its driver sees them."""

    id: str
    osm_way: int
    name: str
    kind: LaneKind
    centerline: Array
    width_m: Quantity
    speed_limit_mps: Quantity
    role: Literal["approach", "exit", "ring", "other"]
    turns: tuple[Turn, ...] = ()
    turns_source: Provenance = "inferred"
    direction_source: Provenance = "inferred"
    left_id: str | None = None
    right_id: str | None = None
    successor_ids: tuple[str, ...] = ()
    """Lanes and connections that begin where this lane ends."""


class Connection(msgspec.Struct, frozen=True, kw_only=True):
    """A legal path through the junction from one lane to another; `centerline` (N, 2)."""

    id: str
    from_lane_id: str
    to_lane_id: str
    turn: Turn
    centerline: Array
    width_m: Quantity
    control: LineControl = "none"
    conflicts_with: tuple[str, ...] = ()
    """Connections whose swept areas cross this one's, from other lanes."""
    yields_to: tuple[str, ...] = ()


class StopLine(msgspec.Struct, frozen=True, kw_only=True):
    """Where vehicles of a lane stop; `ends` (2, 2) from left to right."""

    id: str
    lane_id: str
    ends: Array
    control: Choice


class Crossing(msgspec.Struct, frozen=True, kw_only=True):
    """A place where pedestrians cross; `line` (2, 2) from kerb to kerb."""

    id: str
    line: Array
    width_m: Quantity
    kind: Choice
    """Such as zebra, traffic_signals, unmarked."""
    osm_node: int | None = None


class Signal(msgspec.Struct, frozen=True, kw_only=True):
    """A signal head that governs lanes; `position` (3,), facing `yaw_rad` (towards the driver)."""

    id: str
    osm_node: int | None
    group_id: str
    lane_ids: tuple[str, ...]
    position: Array
    yaw_rad: float
    source: Provenance


class Area(msgspec.Struct, frozen=True, kw_only=True):
    """A polygon: `outline` (N, 2) counter-clockwise, not repeated at the end, and `holes`."""

    id: str
    outline: Array
    holes: tuple[Array, ...] = ()
    source: Provenance = "inferred"


class Building(msgspec.Struct, frozen=True, kw_only=True):
    """A building: footprint and vertical extent above the road."""

    id: str
    outline: Array
    holes: tuple[Array, ...]
    height_m: Quantity
    min_height_m: float = 0.0


class World(msgspec.Struct, frozen=True, kw_only=True):
    """A junction and its surroundings; `id` is a hash of everything else in it."""

    id: str
    intersection: IntersectionSummary
    frame: LocalFrame
    radius_m: float
    map_sha256: str
    arms: tuple[Arm, ...]
    lanes: tuple[Lane, ...]
    connections: tuple[Connection, ...]
    stop_lines: tuple[StopLine, ...]
    crossings: tuple[Crossing, ...]
    signals: tuple[Signal, ...]
    islands: tuple[Area, ...]
    kerbs: tuple[Array, ...]
    """Road edges, each (N, 2)."""
    road_surface: tuple[Area, ...]
    junction_area: Area | None
    buildings: tuple[Building, ...]
    notes: tuple[str, ...] = ()
    """What was guessed or left out, in words."""
    attribution: str = ATTRIBUTION
