"""Ways through an HD map's junctions as a mapper draws them: straight on, crossing at nodes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.geometry.polyline import turn_rad, unit
from tests.world_gen.truth.carriageways import Carriageway
from tests.world_gen.truth.hd_map import HdMap

STRAIGHT_RAD = math.radians(35.0)
_SAME_NODE_M = 4.0
_REACH_M = 45.0


class Port(NamedTuple):
    """One end of a carriageway: its number in the list, and whether it is the line's last point."""

    road: int
    last: bool


class Movement(NamedTuple):
    """A way through a junction: the lane it leaves, the lanes inside, the lane it leads to."""

    from_lane: str
    inside: tuple[str, ...]
    to_lane: str


@dataclass(kw_only=True)
class JunctionWay:
    """A way from one port on; `points` (N, 2) begin at the port, `to` is where it arrives, if."""

    port: Port
    to: Port | None
    points: list[Array]
    two_way: bool
    toward_port: bool = False
    """A one-way that is driven from the junction to the port."""


def movements(hd: HdMap) -> list[Movement]:
    """Return every way of cars through junctions, between lanes that the map holds."""
    found = []
    for lane in hd.lanes.values():
        if lane.inside or lane.kind == "bicycle":
            continue
        paths: list[tuple[str, ...]] = [
            (key,) for key in lane.successors if key in hd.lanes and hd.lanes[key].inside
        ]
        while paths:
            path = paths.pop()
            if hd.lanes[path[-1]].kind == "bicycle" or len(path) > 12:
                continue
            for key in hd.lanes[path[-1]].successors:
                if key in hd.lanes and hd.lanes[key].inside:
                    paths.append((*path, key))
                elif key in hd.lanes and hd.lanes[key].kind != "bicycle":
                    found.append(Movement(lane.id, path, key))
    return found


def turn_of(hd: HdMap, movement: Movement) -> float:
    """Return by how much a movement turns, in radians, left positive."""
    before, after = hd.lanes[movement.from_lane].centerline, hd.lanes[movement.to_lane].centerline
    return float(turn_rad(before[-1] - before[-4], after[3] - after[0]))


@dataclass(kw_only=True)
class Junction:
    """The ports that movements join, and which movement leads from which to which."""

    ports: set[Port] = field(default_factory=set)
    ways: dict[tuple[Port, Port], float] = field(default_factory=dict)
    """How far each pair's straightest movement turns, in radians."""


def junctions(hd: HdMap, roads: list[Carriageway], found: list[Movement]) -> list[Junction]:
    """Return the junctions: ports joined by movements, or by movements that cross."""
    port_of_end, port_of_start = lane_ports(roads)
    merged: list[tuple[set[str], Junction]] = []
    for movement in found:
        if movement.from_lane not in port_of_end or movement.to_lane not in port_of_start:
            continue
        a, b = port_of_end[movement.from_lane], port_of_start[movement.to_lane]
        inside, junction = set(movement.inside), Junction()
        junction.ports |= {a, b}
        junction.ways[a, b] = turn_of(hd, movement)
        for other in [m for m in merged if m[0] & inside or m[1].ports & junction.ports]:
            merged.remove(other)
            inside |= other[0]
            junction.ports |= other[1].ports
            for pair, angle in other[1].ways.items():
                best = junction.ways.get(pair, math.inf)
                junction.ways[pair] = min(angle, best, key=abs)
        merged.append((inside, junction))
    return [junction for _, junction in merged]


def lane_ports(roads: list[Carriageway]) -> tuple[dict[str, Port], dict[str, Port]]:
    """Return at which port each lane ends, and at which it begins."""
    ends, starts = {}, {}
    for i, road in enumerate(roads):
        for key in (*road.forward, *road.tapers[0]):
            ends[key], starts[key] = Port(i, True), Port(i, False)
        for key in (*road.backward, *road.tapers[1]):
            ends[key], starts[key] = Port(i, False), Port(i, True)
    return ends, starts


def place(roads: list[Carriageway], port: Port) -> Array:
    """Return where a port lies, (2,)."""
    return np.asarray(roads[port.road].line[-1 if port.last else 0])


def heading_in(roads: list[Carriageway], port: Port) -> Array:
    """Return the unit vector (2,) from the port into its junction."""
    line = roads[port.road].line
    return unit(line[-1] - line[-2]) if port.last else unit(line[0] - line[1])


def junction_ways(roads: list[Carriageway], junction: Junction) -> list[JunctionWay]:
    """Return the ways through one junction; where ways cross, both have a point at the crossing."""
    ways = _straight(roads, junction)
    served = {(w.port, True) for w in ways} | {(w.to, False) for w in ways if w.to is not None}
    for w in ways:
        if w.two_way and w.to is not None:
            served |= {(w.to, True), (w.port, False)}
    into = {a for a, _ in junction.ways if (a, True) not in served}
    out = {b for _, b in junction.ways if (b, False) not in served}
    rays = [
        JunctionWay(
            port=port,
            to=None,
            points=[place(roads, port), place(roads, port) + _REACH_M * heading_in(roads, port)],
            two_way=port in into and port in out,
            toward_port=port not in into,
        )
        for port in sorted(into | out)
    ]
    if not ways:
        meet = _meeting_point(roads, sorted(junction.ports))
        for ray in rays:
            ray.points[1] = meet
        return rays
    _cross([*ways, *rays], rays)
    return [way for way in [*ways, *rays] if len(way.points) > 1]


def _straight(roads: list[Carriageway], junction: Junction) -> list[JunctionWay]:
    chosen: dict[tuple[Port, Port], None] = {}
    for angle, pair in sorted((abs(angle), pair) for pair, angle in junction.ways.items()):
        starts, ends = {a for a, _ in chosen}, {b for _, b in chosen}
        if angle < STRAIGHT_RAD and (pair[0] not in starts or pair[1] not in ends):
            chosen[pair] = None
    ways = []
    for a, b in chosen:
        if (b, a) in chosen and (b, a) < (a, b):
            continue
        points = [place(roads, a), place(roads, b)]
        ways.append(JunctionWay(port=a, to=b, points=points, two_way=(b, a) in chosen))
    return ways


def _meeting_point(roads: list[Carriageway], ports: list[Port]) -> Array:
    """Return the point nearest to all lines through the ports, in the least squares."""
    total, side = 1e-3 * np.eye(2), np.zeros(2)
    for port in ports:
        d, p = heading_in(roads, port), place(roads, port)
        across = np.eye(2) - np.outer(d, d)
        total, side = total + across + 1e-2 * np.eye(2), side + (across + 1e-2 * np.eye(2)) @ p
    return np.asarray(np.linalg.solve(total, side + 1e-3 * place(roads, ports[0])))


def _cross(ways: list[JunctionWay], rays: list[JunctionWay]) -> None:
    """Put a common point where ways cross; rays end at the farthest of theirs."""
    hits: list[list[tuple[float, Array]]] = [[] for _ in ways]
    nodes: list[Array] = []
    for i, first in enumerate(ways):
        for j in range(i + 1, len(ways)):
            second = ways[j]
            if {first.port, first.to} & {second.port, second.to} - {None}:
                continue
            met = _crossing(first.points, second.points)
            if met is None:
                continue
            s, t, point = met
            near = [node for node in nodes if np.hypot(*(node - point)) < _SAME_NODE_M]
            node = near[0] if near else point
            if not near:
                nodes.append(node)
            hits[i].append((s, node))
            hits[j].append((t, node))
    for way, found in zip(ways, hits, strict=True):
        found.sort(key=lambda hit: hit[0])
        middle: list[Array] = []
        for _, node in found:
            if not any(node is other for other in middle):
                middle.append(node)
        end = [] if any(way is ray for ray in rays) else way.points[-1:]
        way.points = [way.points[0], *middle, *end]


def _crossing(a: list[Array], b: list[Array]) -> tuple[float, float, Array] | None:
    p, r, q, s = a[0], a[-1] - a[0], b[0], b[-1] - b[0]
    det = r[0] * s[1] - r[1] * s[0]
    if abs(det) < 0.1 * np.hypot(*r) * np.hypot(*s):
        return None
    gap = q - p
    t = (gap[0] * s[1] - gap[1] * s[0]) / det
    u = (gap[0] * r[1] - gap[1] * r[0]) / det
    if -0.02 <= t <= 1.02 and -0.02 <= u <= 1.02:
        return float(t), float(u), p + t * r
    return None


def neighbours(hd: HdMap, roads: list[Carriageway]) -> list[tuple[Port, Port]]:
    """Return the pairs of ports where lanes go on without a junction."""
    ends, starts = lane_ports(roads)
    pairs: Mapping[tuple[Port, Port], None] = {
        (ends[key], starts[after]): None
        for key in ends
        for after in hd.lanes[key].successors
        if after in starts
    }
    return list(pairs)
