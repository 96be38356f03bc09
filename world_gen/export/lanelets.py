"""What Lanelet2 and CommonRoad, whose maps are both made of lanelets, say alike.

Which line lies beside a lane and which lane beyond it, which way turns are indicated, crosswalks,
whose limit a turn obeys: much of it OpenDRIVE says, too.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from typing import Literal, NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.world import Connection, Crossing, DrivingSide, Lane, Road, Turn, World
from foretwin.geometry.polyline import left_of, unit
from foretwin.world_gen.export.lane_borders import Borders

URBAN_MPS = 60.0 / 3.6
"""Roads on which one may drive faster count as outside towns."""
Side = Literal["left", "right"]
SIDES: tuple[Side, Side] = ("left", "right")
Paint = Literal["thin", "thick", "kerb", "edge", "none"]
"""A painted line, a kerb, the bare edge of a road without kerbs, or nothing to see."""
Pattern = Literal["dashed", "solid", "solid_solid", "dashed_solid", "solid_dashed", ""]
_UNMARKED_CLASSES = frozenset(
    {"residential", "living_street", "service", "track", "unclassified", "road", "pedestrian"}
)
"""Roads of these classes seldom have a middle line."""
_KERBLESS_CLASSES = frozenset({"motorway", "trunk", "motorway_link", "trunk_link", "track"})


class Marking(NamedTuple):
    """One border of a lane.

    Of `dashed_solid` the dashed line is on the left in driving direction: only traffic left of it
    may cross. `beyond_id` is the lane on the other side, and `oncoming` whether that is driven
    the other way.
    """

    paint: Paint
    pattern: Pattern = ""
    beyond_id: str | None = None
    oncoming: bool = False


def lane_markings(world: World, borders: Mapping[str, Borders]) -> dict[tuple[str, Side], Marking]:
    """Return what lies on both sides of each lane, by its id and the side.

    Lines between lanes follow from `Lane.change`; what no tag says is usual for the road's
    class.
    """
    users: dict[bytes, list[tuple[Lane, Side]]] = defaultdict(list)
    keys: dict[tuple[str, Side], bytes] = {}
    for lane in world.lanes:
        for side, line in zip(SIDES, borders[lane.id], strict=True):
            key = keys[lane.id, side] = _key(line)
            users[key].append((lane, side))
    roads = {road.id: road for road in world.roads}
    found: dict[tuple[str, Side], Marking] = {}
    for lane in world.lanes:
        for side in SIDES:
            beside = [u for u in users[keys[lane.id, side]] if u[0] is not lane]
            road = roads.get(lane.road_id)
            if beside:
                found[lane.id, side] = _between(lane, side, *beside[0], road)
            else:
                kerbless = road is not None and road.road_class in _KERBLESS_CLASSES
                found[lane.id, side] = Marking("edge" if kerbless else "kerb")
    return found


def _key(line: Array) -> bytes:
    """Return the same for a line and its reverse."""
    points = np.rint(line * 1000.0).astype(np.int64)
    return min(points.tobytes(), np.ascontiguousarray(points[::-1]).tobytes())


def _between(lane: Lane, side: Side, other: Lane, its_side: Side, road: Road | None) -> Marking:
    if its_side == side:  # driven the other way
        return _middle_line(other, road)
    if "closed" in (lane.kind, other.kind):
        return Marking("thick", "solid", other.id)  # as beside hard shoulders
    left, right = (other, lane) if side == "left" else (lane, other)
    to_right = left.change in ("both", "right")
    to_left = right.change in ("both", "left")
    paint: Paint = "thin" if left.kind == right.kind else "thick"
    pattern: Pattern = "dashed" if to_left else "dashed_solid"
    if not to_right:
        pattern = "solid_dashed" if to_left else "solid"
    return Marking(paint, pattern, other.id)


def _middle_line(other: Lane, road: Road | None) -> Marking:
    if road is None or road.road_class in _UNMARKED_CLASSES:
        return Marking("none", "", other.id, oncoming=True)
    narrow = len(road.lane_ids) <= 2  # one may overtake over the line
    return Marking("thin", "dashed" if narrow else "solid_solid", other.id, oncoming=True)


def narrower_lane(connection: Connection, lanes: Mapping[str, Lane]) -> Lane:
    """Return of the lanes that a connection joins the one that fewer may use."""
    start, end = lanes[connection.from_lane_id], lanes[connection.to_lane_id]
    return end if start.kind == "driving" else start


def slower_lane(start: Lane, to: Lane) -> Lane:
    """Return which of the lanes that a connection joins has the limit that it obeys."""
    return min(start, to, key=lambda lane: lane.speed_limit_mps.value)


def indicated(turn: Turn, side: DrivingSide) -> Turn:
    """Return the turn as it is indicated: neither format has U-turns, which lead across."""
    across: Turn = "left" if side == "right" else "right"
    return across if turn == "u_turn" else turn


def crosswalk_edges(crossing: Crossing) -> Borders:
    """Return both edges (2, 2) of the stripe on which pedestrians cross, in its direction."""
    start, end = crossing.line
    aside = left_of(unit(end - start)) * (crossing.width_m.value / 2)
    return Borders(crossing.line + aside, crossing.line - aside)


def is_marked(crossing: Crossing) -> bool:
    """Return whether the edges of a crossing are painted."""
    return crossing.kind.value not in ("unmarked", "no")
