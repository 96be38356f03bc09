"""The route: roads to be driven one after the other, and its most probable continuation."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.errors import UserError
from foretwin.contracts.frames import wrap_angle
from foretwin.geometry.polyline import points_at
from foretwin.orchestrator.routing.road_index import legality
from foretwin.world_gen.roads.road_graph import DirectedEdge, EdgeKey, RoadGraph
from foretwin.world_gen.roads.turn_restrictions import UNRESTRICTED, TurnRestrictions

HEADING_OVER_M = 15.0
"""Headings at a node are measured over this length: nearer, maps draw junctions with kinks."""

_LARGE = {"motorway": 0, "trunk": 1, "primary": 2, "secondary": 3, "tertiary": 4}
_SMALL = {"unclassified": 5, "residential": 5, "living_street": 6, "service": 7}
_CLASS_RANK = _LARGE | _SMALL | {"track": 8, "pedestrian": 8}


class RouteError(UserError):
    """A route that cannot be driven on this map; the message is one line."""


@dataclass(frozen=True)
class Route:
    """Directed edges, each beginning where the one before ends.

    `origin_m` is the route's position s at the start of the first edge: it lets a route lose its
    past or change its future while s keeps counting.
    """

    edges: tuple[DirectedEdge, ...]
    origin_m: float = 0.0

    @cached_property
    def start_m(self) -> Array:
        """Position s (N + 1,) where each edge starts; the last value is the route's end."""
        lengths = [directed.edge.length_m for directed in self.edges]
        return self.origin_m + np.concatenate([[0.0], np.cumsum(lengths)])

    @cached_property
    def speed_limit_mps(self) -> Array:
        """The limit (N,) of each edge."""
        return np.array([directed.speed_limit_mps.value for directed in self.edges])

    @cached_property
    def known_offset_m(self) -> dict[int, float]:
        """How far left of the road's line its driven lane lies, by the edge's number, of those
        along which a path has led: `driving_path` fills it, each round asks for most of them."""
        return {}

    @property
    def end_m(self) -> float:
        """Position s of the route's end."""
        return float(self.start_m[-1])

    def index_at(self, s_m: float) -> int:
        """Return which edge holds position `s_m`, clamped to the route."""
        found = int(np.searchsorted(self.start_m, s_m, side="right")) - 1
        return min(max(found, 0), len(self.edges) - 1)

    def line(self, first: int, last: int) -> Array:
        """Return the vertices (N, 2) of the edges `first` to `last`, both included."""
        parts = [self.edges[first].xy_m]
        parts += [self.edges[index].xy_m[1:] for index in range(first + 1, last + 1)]
        return np.concatenate(parts)

    def validate(self) -> Route:
        """Return self, or raise RouteError where it is empty or an edge does not join the next."""
        if not self.edges:
            raise RouteError("route without roads")
        for before, after in zip(self.edges, self.edges[1:], strict=False):
            if before.end_node != after.start_node:
                raise RouteError(
                    f"route jumps from way {before.edge.way_id} (node {before.end_node}) "
                    f"to way {after.edge.way_id} (node {after.start_node})"
                )
        return self


def leaving_heading(directed: DirectedEdge) -> float:
    """Return the heading in radians over the first metres of an edge."""
    line = directed.xy_m
    delta = points_at(line, HEADING_OVER_M) - line[0]
    return math.atan2(delta[1], delta[0])


def arriving_heading(edges: tuple[DirectedEdge, ...]) -> float:
    """Return the heading in radians over the last metres of a sequence of edges.

    Reaches back over edges shorter than that, so that a short link inside a junction does not
    decide what straight on means.
    """
    parts: list[Array] = []
    length_m = 0.0
    for directed in reversed(edges):
        parts.append(directed.xy_m[::-1])
        length_m += directed.edge.length_m
        if length_m >= HEADING_OVER_M:
            break
    backwards = np.concatenate(parts)
    delta = backwards[0] - points_at(backwards, HEADING_OVER_M)
    return math.atan2(delta[1], delta[0])


def turn_angle(before: tuple[DirectedEdge, ...], after: DirectedEdge) -> float:
    """Return the turn in radians from the end of `before` into `after`, positive to the left."""
    return float(wrap_angle(leaving_heading(after) - arriving_heading(before)))


def most_probable_next(
    graph: RoadGraph, before: tuple[DirectedEdge, ...], restrictions: TurnRestrictions
) -> DirectedEdge | None:
    """Return the edge a car most probably takes next, None at a dead end; never a U-turn.

    Straightest first; another name, another class and ground where cars may not drive count as
    further degrees of turn, so that they are taken where nothing better leads on (a recorded
    drive may be older than the map), and so are turns that a restriction forbids. One-way streets
    are not entered the wrong way.
    """
    last = before[-1]
    best: tuple[bool, float, int] | None = None
    choice: DirectedEdge | None = None
    for option in graph.at_node(last.end_node):
        if option.edge.index == last.edge.index or legality(option) == "against_one_way":
            continue
        degrees = abs(math.degrees(turn_angle(before, option)))
        if last.edge.name and option.edge.name != last.edge.name:
            degrees += 20.0
        degrees += 8.0 * max(0, _rank(option) - _rank(last))
        if legality(option) == "no_car_road":
            degrees += 60.0
        if degrees > 60.0 + 150.0:
            continue
        allowed = restrictions.step_allowed(last, option)
        allowed = allowed and restrictions.path_allowed((*before, option))
        rank = (not allowed, degrees, option.edge.index)
        if best is None or rank < best:
            best, choice = rank, option
    return choice


def _rank(directed: DirectedEdge) -> int:
    return _CLASS_RANK.get(directed.edge.road_class.removesuffix("_link"), 6)


def extend_most_probable(
    graph: RoadGraph,
    route: Route,
    *,
    until_m: float,
    restrictions: TurnRestrictions = UNRESTRICTED,
) -> Route:
    """Return `route` continued by the most probable roads until its end lies at `until_m`.

    It ends earlier at a dead end, at the map's edge, or where it would drive the same road a
    third time.
    """
    edges = list(route.edges)
    end_m = route.end_m
    driven: dict[EdgeKey, int] = {}
    while end_m < until_m:
        following = most_probable_next(graph, tuple(edges[-4:]), restrictions)
        if following is None:
            break
        key = following.key
        driven[key] = driven.get(key, 0) + 1
        if driven[key] > 2:
            break
        edges.append(following)
        end_m += following.edge.length_m
    if len(edges) == len(route.edges):
        return route
    return Route(tuple(edges), route.origin_m)
