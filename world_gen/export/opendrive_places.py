"""What joins the roads of an OpenDRIVE file where they meet: links, short roads, junctions."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import count
from typing import NamedTuple

import msgspec
import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.world import Area, Connection, DrivingSide, Lane, Road, World
from foretwin.geometry.polyline import unit
from foretwin.world_gen.export.lanelets import slower_lane
from foretwin.world_gen.export.opendrive_cubics import Cubic, Rise
from foretwin.world_gen.export.opendrive_curve import curve_between, fit_curve
from foretwin.world_gen.export.opendrive_roads import (
    End,
    OdrLane,
    OdrRoad,
    inward,
    roads_of,
    runs_along,
)
from foretwin.world_gen.export.opendrive_sidewalks import sidewalks_of
from foretwin.world_gen.export.opendrive_tapers import taper

MIN_ROAD_M = 0.005
"""Where two lanes meet in one point a connecting road has this length: too short for a gap."""
_SAME_EDGE_M = 0.001
_ASIDE_M = 0.05
"""Lanes of joined roads whose ends lie farther apart are not linked: a file must not jump."""


class OdrConnection(NamedTuple):
    """A connection of the World, its connecting road, and the road that leads onto that."""

    connection: Connection
    road: OdrRoad
    incoming: OdrRoad


class OdrJunction(NamedTuple):
    """A place where roads meet."""

    id: int
    place: str
    junction_id: str
    """The World's junction that it is part of, or empty."""
    connections: tuple[OdrConnection, ...]


class OdrNetwork(NamedTuple):
    """All roads and junctions of a file; `road_of` names the road of each of the World's lanes."""

    rule: DrivingSide
    """The side that lanes to the right of lane 0 are driven along on, as the file says it."""
    roads: tuple[OdrRoad, ...]
    junctions: tuple[OdrJunction, ...]
    road_of: Mapping[str, OdrRoad]
    areas_on_foot: tuple[Area, ...]
    """Sidewalks that are not lanes of a road."""
    connecting: Mapping[str, OdrRoad]
    """The connecting roads of junctions by the World's connections."""

    def road_across(self, name: str) -> OdrRoad | None:
        """Return the road of a lane or connection, None where it has none of its own."""
        return self.road_of.get(name) or self.connecting.get(name)


class _PlainEnd(NamedTuple):
    road: Road
    at_end: bool


@dataclass(slots=True)
class _RoadJoint:
    ends: list[_PlainEnd] = field(default_factory=list)
    connections: list[Connection] = field(default_factory=list)


def network_of(world: World, *, rule: DrivingSide | None = None) -> OdrNetwork:
    """Return the World's roads, joined at every place as the kind of place demands.

    Where two roads merely go on they are linked; where their lanes go on one by one, but bend or
    move aside, a short road bridges the gap; everywhere else is a junction. Lanes are numbered by
    `rule`, without it by the side on which the World drives.
    """
    side = rule or world.intersection.driving_side
    lanes = {lane.id: lane for lane in world.lanes}
    places = _places(world, lanes)
    joined = [place for place in places.values() if _goes_on(place, lanes)]
    sidewalks = sidewalks_of(world)
    roads = roads_of(world, lanes, _headings(joined), sidewalks.beside, side)
    by_source = {road.source: road for road in roads}
    road_of = {lane: road for road in roads for lane in road.numbers}
    for place in joined:
        a, b = (End(by_source[e.road.id], e.at_end) for e in place.ends)
        _join(a, b, lanes)
    junctions: list[OdrJunction] = []
    ids = count(len(roads) + 1)
    for key, place in places.items():
        ends = [End(by_source[e.road.id], e.at_end) for e in place.ends if e.road.id in by_source]
        known = [c for c in place.connections if {c.from_lane_id, c.to_lane_id} <= road_of.keys()]
        if not known and len(ends) < 3:
            continue
        number = next(ids)
        short = taper(key, number, ends, known, lanes, side)
        if short is not None:
            roads.append(short)
            continue
        for end in ends:
            end.link("junction", number)
        made = []
        for connection in known:
            start, to = lanes[connection.from_lane_id], lanes[connection.to_lane_id]
            a, b = End(road_of[start.id], not start.reverse), End(road_of[to.id], to.reverse)
            road = _connecting_road(connection, next(ids), a, b, start, to, side)
            road.junction = number
            a.link("junction", number)
            b.link("junction", number)
            made.append(OdrConnection(connection, road, a.road))
        name = next((c.junction_id for c in known if c.junction_id), "")
        junctions.append(OdrJunction(number, key, name, tuple(made)))
        roads.extend(item.road for item in made)
    return OdrNetwork(
        rule=side,
        roads=tuple(roads),
        junctions=tuple(junctions),
        road_of=road_of,
        areas_on_foot=sidewalks.others,
        connecting={item.connection.id: item.road for j in junctions for item in j.connections},
    )


def _places(world: World, lanes: Mapping[str, Lane]) -> dict[str, _RoadJoint]:
    found: dict[str, _RoadJoint] = defaultdict(_RoadJoint)
    for road in world.roads:
        if not any(i in lanes for i in road.lane_ids):
            continue
        for key, at_end in ((road.from_place, False), (road.to_place, True)):
            if key is not None:
                found[key].ends.append(_PlainEnd(road, at_end))
    for connection in world.connections:
        found[connection.place_id].connections.append(connection)
    return found


def _goes_on(place: _RoadJoint, lanes: Mapping[str, Lane]) -> bool:
    """Return whether lanes of one of two roads lead straight into the other from where they end.

    Their reference lines may lie apart there, as those of roads of another `placement`.
    """
    if len(place.ends) != 2 or place.connections:
        return False
    first, second = (end.road.lane_ids for end in place.ends)
    pairs = _pairs(first, second, lanes) + _pairs(second, first, lanes)
    return any(math.dist(one.centerline[-1], to.centerline[0]) <= _ASIDE_M for one, to in pairs)


def _pairs(
    start: Iterable[str], to: Collection[str], lanes: Mapping[str, Lane]
) -> list[tuple[Lane, Lane]]:
    """Return which lanes of one road, by id, lead straight into which of another."""
    first = (lanes[i] for i in start if i in lanes)
    pairs = ((lane, j) for lane in first for j in lane.successor_ids)
    return [(lane, lanes[j]) for lane, j in pairs if j in to and j in lanes]


def _outward(end: _PlainEnd) -> Array:
    line = end.road.reference_line
    return unit(line[-1] - line[-2] if end.at_end else line[0] - line[1])


def _headings(joined: Sequence[_RoadJoint]) -> dict[tuple[str, bool], Array]:
    """Return the direction that both roads share where one goes on in the other."""
    found: dict[tuple[str, bool], Array] = {}
    for place in joined:
        a, b = place.ends
        shared = unit(_outward(a) - _outward(b))
        found[a.road.id, a.at_end] = shared if a.at_end else -shared
        found[b.road.id, b.at_end] = -shared if b.at_end else shared
    return found


def _join(a: End, b: End, lanes: Mapping[str, Lane]) -> None:
    """Link two roads and those of their lanes that go on."""
    a.link("road", b.road.id, at_end=b.at_end)
    b.link("road", a.road.id, at_end=a.at_end)
    for start, to in ((a, b), (b, a)):
        for one, other in _pairs(start.road.numbers, to.road.numbers, lanes):
            if one.reverse == start.at_end or other.reverse != to.at_end:
                continue
            gap = start.lane_end(one).point - to.lane_end(other).point
            if math.hypot(*gap) <= _ASIDE_M:
                _link_lanes(start, start.road.numbers[one.id], to, to.road.numbers[other.id])
    same_way = 1 if a.at_end != b.at_end else -1
    for mine in (lane.number for lane in a.road.lanes if lane.sidewalk):
        for theirs in (lane.number for lane in b.road.lanes if lane.sidewalk):
            if mine * theirs * same_way > 0 and _same_strip(a, mine, b, theirs, same_way):
                _link_lanes(a, mine, b, theirs)


def _same_strip(a: End, mine: int, b: End, theirs: int, same_way: int) -> bool:
    """Return whether two strips that are not driven on meet edge to edge."""
    edges = (mine, theirs), (inward(mine), inward(theirs))
    return all(abs(a.edge_m(m) - same_way * b.edge_m(n)) < _SAME_EDGE_M for m, n in edges)


def _link_lanes(a: End, number: int, b: End, other: int) -> None:
    a.link_lane(number, other)
    b.link_lane(other, number)


def _connecting_road(
    connection: Connection, number: int, a: End, b: End, start: Lane, to: Lane, side: DrivingSide
) -> OdrRoad:
    """Return the road of one connection: one lane about its middle, tangent to both lanes."""
    begin, finish = a.lane_end(start), b.lane_end(to)
    if math.hypot(*(finish.point - begin.point)) < MIN_ROAD_M:
        beyond = begin.point + begin.heading * MIN_ROAD_M
        curve = curve_between(begin.point, begin.heading, beyond, begin.heading)
    else:
        line = np.concatenate([begin.point[None], connection.centerline[1:-1], finish.point[None]])
        curve = fit_curve(line, start=begin.heading, end=finish.heading)
    lane_number = -1 if runs_along(-1, side) else 1
    first, last = start.width_m.value, to.width_m.value
    half = -0.5 * lane_number
    limit = slower_lane(start, to).speed_limit_mps
    lane = OdrLane(
        number=lane_number,
        width=Cubic.between(first, last, curve.length_m),
        lane=msgspec.structs.replace(to, speed_limit_mps=limit),
        predecessor=a.road.numbers[start.id],
        successor=b.road.numbers[to.id],
    )
    return OdrRoad(
        id=number,
        name=a.road.name,
        source=connection.id,
        curve=curve,
        offset=Cubic.between(half * first, half * last, curve.length_m),
        lanes=[lane],
        road_class=a.road.road_class,
        height=Rise.joining(a.height_m, a.grade_out, b.height_m, -b.grade_out, curve.length_m),
        predecessor=("road", a.road.id, a.at_end),
        successor=("road", b.road.id, b.at_end),
    )
