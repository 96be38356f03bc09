"""The World: one junction and its surroundings in metres, as every room sees it.

All geometry is in the World's own local frame (origin at the junction's centre). Every value
that a map can lack says whether it was tagged in the map, inferred from it, or a default.
"""

from __future__ import annotations

from typing import Literal, get_args

import msgspec

from foretwin.contracts.arrays import Array
from foretwin.contracts.beside_road import Building, Obstacle
from foretwin.contracts.elevation import Elevation
from foretwin.contracts.frames import LocalFrame
from foretwin.contracts.provenance import Choice, PlaceSource, Provenance, Quantity
from foretwin.contracts.signals import Signal, SignalPlan

_RingKind = Literal["roundabout", "circular", "mini_roundabout"]
_PlainKind = Literal["crossing", "t_junction", "y_junction", "staggered", "merge", "other"]
ROUNDABOUT_KINDS = frozenset(get_args(_RingKind))
"""Junctions whose traffic goes round."""
JunctionKind = Literal[_RingKind, _PlainKind, "region"]
"""`region` is no junction: it names a World made of a whole stretch of map."""
Control = Literal["signals", "stop", "all_way_stop", "give_way", "roundabout", "uncontrolled"]
DrivingSide = Literal["right", "left"]
LaneKind = Literal["driving", "bus", "bicycle", "parking", "tram", "closed"]
"""What a lane is for; `closed` ones are nobody's: hard shoulders, lanes that a tag bars."""
Turn = Literal["straight", "left", "right", "u_turn"]
LineControl = Literal["signal", "stop", "give_way", "none"]
LaneChange = Literal["both", "left", "right", "none"]
"""To which sides, as the driver sees them, a lane may be left."""
_YieldByRoad = Literal["stop", "give_way", "roundabout", "priority_road", "lesser_road"]
_YieldByMovement = Literal["turn_across", "near_side", "u_turn", "merge_order", "order"]
_YieldByCountry = Literal["far_side"]
YieldRule = Literal[_YieldByRoad, _YieldByMovement, _YieldByCountry]
"""Why one movement waits for another.

A stop or give-way sign, a ring, a signed priority road, a road of lower class or a way out of a
yard, a turn across oncoming traffic, who comes from the near side (right before left where traffic
keeps right), in some countries the far side, a U-turn, merging lanes, or, without a rule, an order.
"""

ATTRIBUTION = "© OpenStreetMap contributors"
"""Stands in every picture, report and export made from OpenStreetMap data."""

DRAWN_GENERATOR = "foretwin draw_town"
"""How the generator of a map drawn for foretwin begins."""
DRAWN_ATTRIBUTION = "drawn for foretwin, an invented town"
"""Stands in OpenStreetMap's place where the map is none of theirs."""


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


class Road(msgspec.Struct, frozen=True, kw_only=True):
    """A stretch of street between two places where lanes meet, with its lanes side by side.

    `reference_line` (N, 2) runs along the OSM way's nodes; lanes and edges lie beside it:
    `left_m` and `right_m` are how far the carriageway's edges lie to its left (`right_m` is
    usually negative). `lane_ids` stand from left to right, of both directions. `from_place`
    and `to_place` name where lanes meet at its ends (see `Connection`); None at the World's edge.
    """

    id: str
    osm_way: int
    name: str
    road_class: str
    reference_line: Array
    left_m: float
    right_m: float
    lane_ids: tuple[str, ...]
    lane_count_source: Provenance = "inferred"
    """Where the number of lanes came from; of two directions the less certain."""
    from_place: str | None = None
    to_place: str | None = None
    layer: int = 0
    bridge: bool = False
    tunnel: bool = False


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
    """Neighbours that are driven the same way."""
    change: LaneChange = "both"
    change_source: Provenance = "default"
    road_id: str = ""
    reverse: bool = False
    """Driven against the road's reference line."""
    left_of_reference_m: float = 0.0
    """How far the lane's middle lies to the left of the road's reference line."""
    layer: int = 0
    successor_ids: tuple[str, ...] = ()
    """Lanes and connections that begin where this lane ends."""
    position_source: PlaceSource | msgspec.UnsetType = msgspec.UNSET


class Connection(msgspec.Struct, frozen=True, kw_only=True):
    """A legal path through the junction from one lane to another; `centerline` (N, 2).

    `place_id` is where its lanes meet: one place for each node of a ring, else one for a junction.
    `junction_id` is empty where roads merely go on or part without what drivers call a junction.
    """

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
    junction_id: str = ""
    place_id: str = ""
    signal_group_id: str | None = None
    layer: int = 0
    path_source: PlaceSource | msgspec.UnsetType = msgspec.UNSET
    red_after_stop: bool | msgspec.UnsetType = msgspec.UNSET
    """Whether its driver may go on red after a stop; written where it is so."""


class Conflict(msgspec.Struct, frozen=True, kw_only=True):
    """Two connections of one junction whose paths meet, and the one of them that waits.

    `point` (2,) is where their middles cross or come nearest, `area` (N, 2) the outline of the
    ground both sweep. The answer holds wherever no signal says otherwise.
    """

    first_id: str
    second_id: str
    kind: Literal["crossing", "merging"]
    point: Array
    area: Array
    yields_id: str
    rule: YieldRule
    source: Provenance

    @property
    def goes_id(self) -> str:
        """The connection that does not wait."""
        return self.second_id if self.yields_id == self.first_id else self.first_id


class StopLine(msgspec.Struct, frozen=True, kw_only=True):
    """Where vehicles stop; `ends` (2, 2) from left to right.

    It lies across the lane `lane_id`, or, where that begins behind the place, as where the map
    parts a road at a crossing, across the lane that it goes on from. Where `connection_id` is
    given, it lies at a sign inside the junction: across that connection, which begins at the lane.
    """

    id: str
    lane_id: str
    ends: Array
    control: Choice
    connection_id: str | None = None

    @property
    def across_id(self) -> str:
        """The lane or connection that it lies across."""
        return self.connection_id or self.lane_id


class Crossing(msgspec.Struct, frozen=True, kw_only=True):
    """A place where pedestrians cross; `line` (2, 2) from kerb to kerb."""

    id: str
    line: Array
    width_m: Quantity
    kind: Choice
    """Such as zebra, traffic_signals, unmarked."""
    osm_node: int | None = None
    island: bool = False
    """Whether a refuge in the middle parts it."""


class Area(msgspec.Struct, frozen=True, kw_only=True):
    """A polygon: `outline` (N, 2) counter-clockwise, not repeated at the end, and `holes`."""

    id: str
    outline: Array
    holes: tuple[Array, ...] = ()
    source: Provenance = "inferred"


class WorldJunction(msgspec.Struct, frozen=True, kw_only=True):
    """A junction that lies whole in a World; connections name it by `summary.id`."""

    summary: IntersectionSummary
    arms: tuple[Arm, ...]
    area: Area | None
    plan: SignalPlan | None = None


class World(msgspec.Struct, frozen=True, kw_only=True):
    """A junction, or a region, and its surroundings; `id` is a hash of everything else in it.

    It ends `radius_m` around the origin, or, where `bounds_m` (west, south, east, north) is
    given, at that rectangle. `junctions` are all that lie whole in it, the one that it is made
    for first.
    """

    id: str
    intersection: IntersectionSummary
    frame: LocalFrame
    radius_m: float
    map_sha256: str
    lanes: tuple[Lane, ...]
    connections: tuple[Connection, ...]
    stop_lines: tuple[StopLine, ...]
    crossings: tuple[Crossing, ...]
    signals: tuple[Signal, ...]
    islands: tuple[Area, ...]
    kerbs: tuple[Array, ...]
    """Road edges, each (N, 2)."""
    road_surface: tuple[Area, ...]
    buildings: tuple[Building, ...]
    junctions: tuple[WorldJunction, ...] = ()
    roads: tuple[Road, ...] = ()
    conflicts: tuple[Conflict, ...] = ()
    crossing_plans: tuple[SignalPlan, ...] = ()
    """Of lights that stand away from junctions, such as those for people on foot."""
    sidewalks: tuple[Area, ...] = ()
    bounds_m: tuple[float, float, float, float] | None = None
    notes: tuple[str, ...] = ()
    """What was guessed or left out, in words."""
    attribution: str = ATTRIBUTION
    obstacles: tuple[Obstacle, ...] = ()
    cut_away: tuple[Area, ...] | msgspec.UnsetType = msgspec.UNSET
    """What the map has of buildings where lanes lead, with no way through or below them: it stands
    in nobody's way here, but no scenario is placed on it. Where there is none it is not written."""
    elevation: Elevation | msgspec.UnsetType = msgspec.UNSET
    """Where no elevation model was given, the World is flat, and this is not written."""
