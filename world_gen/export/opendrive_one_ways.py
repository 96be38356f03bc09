"""Roads of left-hand traffic as one-way roads, for formats that know right-hand traffic alone.

OpenDRIVE 1.4 has no rule of the road: lanes to the right of lane 0 are driven along the reference
line, those to the left against it. A road whose directions are the other way round becomes two
roads about the same line, each with its lanes on one side of its own lane 0.
"""

from __future__ import annotations

import re
from collections import defaultdict
from typing import NamedTuple

import msgspec

from foretwin.contracts.elevation import Elevation
from foretwin.contracts.world import Area, Connection, Lane, Road, World

SECOND = "~"
"""Ends the id of the road of the lanes to the right."""
_SIDEWALK = re.compile(r"^sidewalk:(?P<road>.+):(?P<side>left|right)(?P<rest>(-\d+)?)$")


def parted_by_direction(world: World) -> World:
    """Return the World with a road for each direction, joined where roads merely go on.

    The first of two keeps the road's id. A place where two roads go on in each other becomes one
    for each direction; at junctions all meet as before.
    """
    lanes = {lane.id: lane for lane in world.lanes}
    parts = {road.id: _parts(road, lanes) for road in world.roads}
    places = _parted_places(world)
    of_lane = {name: road for road in world.roads for name in road.lane_ids}
    return msgspec.structs.replace(
        world,
        roads=tuple(
            _placed(part, road, lanes, places) for road in world.roads for part in parts[road.id]
        ),
        connections=tuple(_joined(c, of_lane, places) for c in world.connections),
        elevation=_both_high(world, parts),
        sidewalks=tuple(_renamed(area, parts) for area in world.sidewalks),
    )


def _parts(road: Road, lanes: dict[str, Lane]) -> tuple[Road, ...]:
    """Return the roads of the two directions, or the road itself where it has one."""
    mine = [lanes[name] for name in road.lane_ids if name in lanes]
    mine.sort(key=lambda lane: -lane.left_of_reference_m)
    cut = _first_against(mine)
    if cut in (0, len(mine)):
        return (road,)
    between = mine[cut]
    edge_m = between.left_of_reference_m + between.width_m.value / 2.0
    first, second = ([lane.id for lane in some] for some in (mine[:cut], mine[cut:]))
    return (
        msgspec.structs.replace(road, lane_ids=tuple(first), right_m=edge_m),
        msgspec.structs.replace(road, id=road.id + SECOND, lane_ids=tuple(second), left_m=edge_m),
    )


def _first_against(lanes: list[Lane]) -> int:
    """Return from which lane on, from the left, most are driven against the line."""
    wrong = [
        sum(lane.reverse for lane in lanes[:i]) + sum(not lane.reverse for lane in lanes[i:])
        for i in range(len(lanes) + 1)
    ]
    return wrong.index(min(wrong))


class _Ends(NamedTuple):
    roads: list[str]
    junctions: set[str]


def _parted_places(world: World) -> dict[str, tuple[str, str]]:
    """Return the places at which one road goes on in another, and these roads."""
    at: dict[str, _Ends] = defaultdict(lambda: _Ends([], set()))
    for road in world.roads:
        for place in (road.from_place, road.to_place):
            if place is not None:
                at[place].roads.append(road.id)
    for connection in world.connections:
        at[connection.place_id].junctions.add(connection.junction_id)
    return {
        place: (ends.roads[0], ends.roads[1])
        for place, ends in at.items()
        if len(set(ends.roads)) == len(ends.roads) == 2 and not any(ends.junctions)
    }


def _toward(place: str, road: str) -> str:
    return f"{place}>{road}"


def _placed(
    part: Road, whole: Road, lanes: dict[str, Lane], places: dict[str, tuple[str, str]]
) -> Road:
    """Return a part whose ends lie at the places of its direction."""
    mine = [lanes[name].reverse for name in part.lane_ids if name in lanes]
    along = 2 * sum(mine) <= len(mine)

    def named(place: str | None, *, at_end: bool) -> str | None:
        if place is None or place not in places:
            return place
        first, second = places[place]
        other = second if whole.id == first else first
        return _toward(place, other if at_end == along else whole.id)

    return msgspec.structs.replace(
        part,
        from_place=named(part.from_place, at_end=False),
        to_place=named(part.to_place, at_end=True),
    )


def _joined(
    connection: Connection, of_lane: dict[str, Road], places: dict[str, tuple[str, str]]
) -> Connection:
    if connection.place_id not in places:
        return connection
    place = _toward(connection.place_id, of_lane[connection.to_lane_id].id)
    return msgspec.structs.replace(connection, place_id=place)


def _both_high(world: World, parts: dict[str, tuple[Road, ...]]) -> Elevation | msgspec.UnsetType:
    """Return the heights, those of a road for both of its parts."""
    elevation = world.elevation
    if elevation is msgspec.UNSET:
        return elevation
    known = elevation.roads
    more = [
        msgspec.structs.replace(profile, id=profile.id + SECOND)
        for profile in known
        if len(parts.get(profile.id, ())) > 1
    ]
    return msgspec.structs.replace(elevation, roads=(*known, *more))


def _renamed(area: Area, parts: dict[str, tuple[Road, ...]]) -> Area:
    """Return a sidewalk named after the part that it lies beside."""
    found = _SIDEWALK.match(area.id)
    if found is None or found["side"] == "left" or len(parts.get(found["road"], ())) < 2:
        return area
    return msgspec.structs.replace(
        area, id=f"sidewalk:{found['road']}{SECOND}:right{found['rest']}"
    )
