"""Legal movements: from which leg of a cluster to which other, along which inner edges."""

from __future__ import annotations

import heapq
import math
from itertools import accumulate, pairwise

import msgspec
import numpy as np

from foretwin.contracts.world import DrivingSide, Turn
from foretwin.geometry.bends import MIN_STEP_M
from foretwin.world_gen.lanes.cluster import Cluster
from foretwin.world_gen.lanes.clusters import Surroundings
from foretwin.world_gen.lanes.legs import Heads, is_ring_edge, opposed
from foretwin.world_gen.roads.headings import dot, heading_out
from foretwin.world_gen.roads.road_graph import DirectedEdge, EdgeKey
from foretwin.world_gen.roads.turn_restrictions import TurnRestrictions

STRAIGHT_RAD = math.radians(45.0)
U_TURN_RAD = math.radians(150.0)
_FARTHEST_BACK_RAD = math.radians(240.0)
"""Who turns farther, round a loop, goes on to the other side and not back."""
_NOSE_COS = math.cos(math.radians(60.0))


class Movement(msgspec.Struct, frozen=True, kw_only=True):
    """One legal way through a cluster; `toward` ends at it, `away` begins there."""

    toward: DirectedEdge
    away: DirectedEdge
    inside: tuple[DirectedEdge, ...]
    turn: Turn
    angle_rad: float


def movements(
    cluster: Cluster, around: Surroundings, restrictions: TurnRestrictions
) -> tuple[Movement, ...]:
    """Return every movement that one-ways and turn restrictions allow.

    Turning back into the street one comes from is none, unless a lane is marked for it, nor is
    turning around the nose of the island where a street parts into two carriageways.
    """
    inner: dict[int, list[DirectedEdge]] = {}
    for index in sorted(cluster.inner):
        edge = around.edges.get(index)
        if edge is None:
            continue
        for directed in (DirectedEdge(edge, False), DirectedEdge(edge, True)):
            if directed.allowed:
                inner.setdefault(directed.start_node, []).append(directed)
    found: list[Movement] = []
    for leg in cluster.legs:
        toward = leg.back
        if not toward.allowed:
            continue
        lanes = around.section(toward).lanes
        marked = any("u_turn" in lane.turns for lane in lanes if lane.reverse == toward.reverse)
        ways = _ways_through(cluster, toward, inner, restrictions, back=marked)
        # Who has no other way out of a street may turn back.
        ways = [
            (away, inside)
            for away, inside in ways
            if not _around_a_nose(cluster, toward, away)
            and (marked or not _back_along(toward, away))
        ] or ways
        found.extend(_with_turns(toward, ways, around.heads, around.driving_side))
    return tuple(found)


def _ways_through(
    cluster: Cluster,
    toward: DirectedEdge,
    inner: dict[int, list[DirectedEdge]],
    restrictions: TurnRestrictions,
    *,
    back: bool,
) -> list[tuple[DirectedEdge, tuple[DirectedEdge, ...]]]:
    """Return (leg, inner edges) by the shortest legal path to every leg, over pairs of edges."""
    exits: dict[int, list[DirectedEdge]] = {}
    for leg in cluster.legs:
        if leg.allowed:
            exits.setdefault(leg.start_node, []).append(leg)
    best: dict[EdgeKey, tuple[DirectedEdge, tuple[DirectedEdge, ...]]] = {}
    done: set[EdgeKey] = set()
    queue: list[tuple[float, int, DirectedEdge, tuple[DirectedEdge, ...]]] = [(0.0, 0, toward, ())]
    count = 0
    while queue:
        cost, _, last, path = heapq.heappop(queue)
        if last.key in done:
            continue
        done.add(last.key)
        for leg in exits.get(last.end_node, ()):
            if leg.key in best or not restrictions.step_allowed(last, leg):
                continue
            if leg.edge.index == toward.edge.index and not (back and not path):
                continue
            if restrictions.path_allowed((toward, *path, leg)):
                best[leg.key] = (leg, path)
        steps = inner.get(last.end_node)
        if not steps:
            continue
        passed = {toward.end_node, *(part.end_node for part in path)}
        for step in steps:
            # Around an island and back to the same node nobody means to go.
            if step.end_node in passed or not restrictions.step_allowed(last, step):
                continue
            count += 1
            heapq.heappush(queue, (cost + step.edge.length_m, count, step, (*path, step)))
    return [best[key] for key in sorted(best)]


def _around_a_nose(cluster: Cluster, toward: DirectedEdge, away: DirectedEdge) -> bool:
    """Return whether a way leads from one carriageway back into the other where they part."""
    if len(cluster.legs) != 3 or len(cluster.nodes) != 1 or is_ring_edge(toward.edge):
        return False
    one_way = [leg for leg in cluster.legs if leg.edge.one_way]
    if {leg.edge.index for leg in one_way} != {toward.edge.index, away.edge.index}:
        return False
    return dot(heading_out(toward.back), heading_out(away)) > _NOSE_COS


def _back_along(toward: DirectedEdge, away: DirectedEdge) -> bool:
    """Return whether a way leads back along the other carriageway of the same street."""
    a, b = toward.edge, away.edge
    same = a.name == b.name if a.name or b.name else a.road_class == b.road_class
    return same and _parting(toward, away) and not (is_ring_edge(a) or is_ring_edge(b))


def _parting(toward: DirectedEdge, away: DirectedEdge) -> bool:
    """Return whether two one-way roads part where one ends and the other begins."""
    a, b = toward.edge, away.edge
    both = a.one_way and b.one_way and toward.end_node == away.start_node
    return both and opposed(toward.back, away)


def _with_turns(
    toward: DirectedEdge,
    ways: list[tuple[DirectedEdge, tuple[DirectedEdge, ...]]],
    heads: Heads,
    driving_side: DrivingSide,
) -> list[Movement]:
    x, y = heads[toward.back.key]
    angles = []
    for leg, _ in ways:
        u, v = heads[leg.key]
        angles.append(math.atan2(y * u - x * v, -x * u - y * v))
    straightest = min((abs(a) for a in angles), default=0.0)
    off_ring = not is_ring_edge(toward.edge)
    found = []
    for (leg, path), angle in zip(ways, angles, strict=True):
        turn = _turn(angle, straightest, angles)
        if not off_ring or is_ring_edge(leg.edge):
            turn = _ring_turn(toward, leg, driving_side)
        elif (
            toward.edge.index == leg.edge.index
            or _parting(toward, leg)
            or (abs(angle) > U_TURN_RAD and (path or toward.end_node != leg.start_node))
            or math.pi < abs(_turned_rad(toward, path, leg)) < _FARTHEST_BACK_RAD
        ):
            turn = "u_turn"
        found.append(Movement(toward=toward, away=leg, inside=path, turn=turn, angle_rad=angle))
    return found


def _turned_rad(toward: DirectedEdge, path: tuple[DirectedEdge, ...], away: DirectedEdge) -> float:
    """Return how far is turned in all along the roads inside a place, positive to the left.

    That is more than half a turn where these lead around an island.
    """
    if not path:
        return 0.0
    return sum(_bends_rad(toward, path, away))


def parts_softly(movement: Movement) -> bool:
    """Return whether a way through a place nowhere heads `STRAIGHT_RAD` or more aside."""
    if abs(movement.angle_rad) >= STRAIGHT_RAD:
        return False
    bends_rad = _bends_rad(movement.toward, movement.inside, movement.away)
    return all(abs(turned_rad) < STRAIGHT_RAD for turned_rad in accumulate(bends_rad))


def _bends_rad(
    toward: DirectedEdge, path: tuple[DirectedEdge, ...], away: DirectedEdge
) -> list[float]:
    """Return the bends on a way through a place, positive to the left."""
    into = heading_out(toward.back)
    heads = [(-into[0], -into[1])]
    for part in path:
        steps = np.diff(part.xy_m, axis=0).tolist()
        heads += [(x, y) for x, y in steps if math.hypot(x, y) > MIN_STEP_M]
    heads.append(heading_out(away))
    return [math.atan2(x * v - y * u, x * u + y * v) for (x, y), (u, v) in pairwise(heads)]


def _turn(angle: float, straightest: float, angles: list[float]) -> Turn:
    if abs(angle) >= STRAIGHT_RAD:
        return "left" if angle > 0 else "right"
    if abs(angle) <= straightest + 1e-9:
        return "straight"
    return "left" if angle > min(angles, key=abs) else "right"


def _ring_turn(toward: DirectedEdge, away: DirectedEdge, driving_side: DrivingSide) -> Turn:
    if is_ring_edge(toward.edge) and is_ring_edge(away.edge):
        return "straight"
    return "right" if driving_side == "right" else "left"
