"""Looks into the road graph: which edges lie near a point, and what can be reached from an edge."""

from __future__ import annotations

import heapq
import math
from typing import NamedTuple

import numpy as np
import shapely

from foretwin.contracts.arrays import Array
from foretwin.world_gen.roads.road_graph import DirectedEdge, EdgeKey, RoadGraph
from foretwin.world_gen.roads.turn_restrictions import TurnRestrictions

NOT_FOR_CARS_FACTOR = 2.0
AGAINST_ONE_WAY_FACTOR = 4.0
U_TURN_M = 60.0
LOOSE_END_M = 12.0
REACH_M = 80.0
"""What can be reached within this is remembered, of so many edges."""
_MOST_KNOWN = 2000


def legality(directed: DirectedEdge) -> str:
    """Say whether a car may drive here: car, no_car_road, or against_one_way."""
    if directed.allowed:
        return "car" if directed.edge.car else "no_car_road"
    if directed.back.allowed:
        return "against_one_way"
    return "no_car_road"


def travel_factor(directed: DirectedEdge) -> float:
    """Return how much longer than it is an edge seems to a driver who prefers legal car roads."""
    return {"car": 1.0, "no_car_road": NOT_FOR_CARS_FACTOR}.get(
        legality(directed), AGAINST_ONE_WAY_FACTOR
    )


class NearEdge(NamedTuple):
    """A point projected on an edge in driving direction; `lateral_m` is positive to the left."""

    directed_edge: DirectedEdge
    s_m: float
    lateral_m: float
    distance_m: float
    heading_rad: float


class Reached(NamedTuple):
    """A directed edge within reach of another one's end.

    `gap_m` is the distance from that end to this edge's start, `effort_m` the same with detours
    over forbidden ground counted longer, `via` the edges in between.
    """

    directed_edge: DirectedEdge
    gap_m: float
    effort_m: float
    via: tuple[DirectedEdge, ...]


def project(directed: DirectedEdge, xy_m: Array) -> NearEdge:
    """Project one point (2,) onto a directed edge."""
    line = directed.xy_m
    start, leg = line[:-1], np.diff(line, axis=0)
    leg_m = np.hypot(leg[:, 0], leg[:, 1])
    safe_m = np.maximum(leg_m, 1e-9)
    share = np.clip(((xy_m - start) * leg).sum(axis=1) / safe_m**2, 0.0, 1.0)
    off = xy_m - (start + share[:, None] * leg)
    distance = np.hypot(off[:, 0], off[:, 1])
    best = int(distance.argmin())
    cross = leg[best, 0] * off[best, 1] - leg[best, 1] * off[best, 0]
    return NearEdge(
        directed,
        float(leg_m[:best].sum() + share[best] * leg_m[best]),
        float(math.copysign(distance[best], cross)),
        float(distance[best]),
        math.atan2(leg[best, 1], leg[best, 0]),
    )


class RoadIndex:
    """A spatial index of a graph's edges and a memory of what is reachable from them."""

    def __init__(self, graph: RoadGraph) -> None:
        self.graph = graph
        self._tree = shapely.STRtree([shapely.LineString(edge.xy_m) for edge in graph.edges])
        self._reached: dict[EdgeKey, dict[EdgeKey, Reached]] = {}

    def near(self, xy_m: Array, radius_m: float) -> list[NearEdge]:
        """Return both directions of every edge within `radius_m` of (2,) `xy_m`, nearest first.

        A point off the loose end of a road (where the map was cut) by more than `LOOSE_END_M` is
        not near it.
        """
        found = self._tree.query(
            shapely.Point(float(xy_m[0]), float(xy_m[1])), predicate="dwithin", distance=radius_m
        )
        result: list[NearEdge] = []
        for index in sorted(int(i) for i in found):
            edge = self.graph.edges[index]
            forth = project(DirectedEdge(edge, False), xy_m)
            if forth.distance_m > LOOSE_END_M and self._off_loose_end(forth):
                continue
            result.append(forth)
            result.append(
                NearEdge(
                    DirectedEdge(edge, True),
                    max(0.0, float(edge.length_m) - forth.s_m),
                    -forth.lateral_m,
                    forth.distance_m,
                    forth.heading_rad + math.pi,
                )
            )
        result.sort(key=lambda near: (near.distance_m, near.directed_edge.key))
        return result

    def _off_loose_end(self, near: NearEdge) -> bool:
        directed = near.directed_edge
        if near.s_m <= 0.0:
            return len(self.graph.at_node(directed.start_node)) == 1
        if near.s_m >= directed.edge.length_m - 1e-6:
            return len(self.graph.at_node(directed.end_node)) == 1
        return False

    def reached(
        self, start: DirectedEdge, *, limit_m: float | None = None
    ) -> dict[EdgeKey, Reached]:
        """Return what can be reached from the end of `start`, without turning round in the road."""
        if limit_m is not None and limit_m > REACH_M:
            return reach(self.graph, start, limit_m=limit_m)
        key = start.key
        if key not in self._reached:
            while len(self._reached) >= _MOST_KNOWN:
                del self._reached[next(iter(self._reached))]
            self._reached[key] = reach(self.graph, start, limit_m=REACH_M)
        return self._reached[key]


def reach(
    graph: RoadGraph,
    start: DirectedEdge,
    *,
    limit_m: float,
    lawful: TurnRestrictions | None = None,
) -> dict[EdgeKey, Reached]:
    """Search outward from the end of `start` (Dijkstra on directed edges) up to `limit_m` of road.

    Forbidden ground counts longer than it is and turning round costs `U_TURN_M`; for who drives
    `lawful`ly both are left out, and so are turns that these restrictions forbid.
    """
    result: dict[EdgeKey, Reached] = {}
    queue: list[tuple[float, int, float, DirectedEdge, tuple[DirectedEdge, ...]]] = []
    count = 0

    def push(last: DirectedEdge, effort: float, gap: float, via: tuple[DirectedEdge, ...]) -> None:
        nonlocal count
        for step in graph.at_node(last.end_node):
            turned = last.turns_back(step)
            if lawful is not None and (
                turned
                or legality(step) != "car"
                or not lawful.step_allowed(last, step)
                or not lawful.path_allowed((start, *via, step))
            ):
                continue
            heapq.heappush(queue, (effort + (U_TURN_M if turned else 0.0), count, gap, step, via))
            count += 1

    push(start, 0.0, 0.0, ())
    while queue:
        effort, _, gap, step, via = heapq.heappop(queue)
        key = step.key
        if key in result:
            continue
        result[key] = Reached(step, gap, effort, via)
        end_gap = gap + step.edge.length_m
        if end_gap <= limit_m:
            push(step, effort + step.edge.length_m * travel_factor(step), end_gap, (*via, step))
    return result
