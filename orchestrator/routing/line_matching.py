"""Turns a drawn or driven line into a route on the map, looking at the whole line at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import local_from_geo
from foretwin.geometry.polyline import headings_rad
from foretwin.orchestrator.routing.road_hypotheses import (
    Hypothesis,
    first_hypotheses,
    next_hypotheses,
)
from foretwin.orchestrator.routing.road_index import NearEdge, RoadIndex
from foretwin.orchestrator.routing.route import Route, RouteError
from foretwin.orchestrator.routing.shortest_paths import ShortestWays
from foretwin.orchestrator.routing.spurs import EdgeVisit, without_spurs
from foretwin.world_gen.roads.road_graph import DirectedEdge, RoadGraph

NEAR_ROAD_M = 30.0
BRIDGE_UP_TO_M = 400.0
SPACING_M = 8.0
"""Between the points that are matched; points of a standing car fall together."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MatchedRoute:
    """Where a line runs on the map.

    `routes` are connected stretches, in order: a line that leaves the map for long and comes back
    has several. `near_road_share` is the share of the line within 30 m of a road; `bridged_m` the
    length that was filled in by shortest paths.
    """

    routes: tuple[Route, ...]
    near_road_share: float
    bridged_m: float


def match_line(
    graph: RoadGraph,
    lat_lon_deg: Array,
    *,
    name: str = "route",
    index: RoadIndex | None = None,
) -> MatchedRoute:
    """Return the roads along a line (N, 2) of latitudes and longitudes in degrees.

    The most probable sequence by Viterbi's algorithm over the whole line. Where no road follows
    the line for up to `BRIDGE_UP_TO_M`, the shortest way fills the gap, over pedestrian streets
    too if need be. Times and speeds play no part. Raises RouteError naming `name` where the line
    has fewer than two points or lies off the map.
    """
    line = np.asarray(lat_lon_deg, dtype=np.float64).reshape(-1, 2)
    line = line[np.isfinite(line).all(axis=1)]
    if len(line) < 2:
        raise RouteError(f"{name} has {len(line)} usable points; at least 2 are needed")
    xy = spaced(local_from_geo(graph.frame, line[:, 0], line[:, 1]), SPACING_M)
    if len(xy) < 2:
        raise RouteError(f"{name} is shorter than {SPACING_M:.0f} m: nothing to drive")
    roads = index or RoadIndex(graph)
    share = _near_share(roads, xy)
    pieces = _match_pieces(roads, xy)
    routes, bridged_m = _join(graph, pieces)
    if share < 0.05 or not routes:
        raise RouteError(
            f"{name} is off the map: {100 * share:.0f} % of its points lie within "
            f"{NEAR_ROAD_M:.0f} m of a road"
        )
    return MatchedRoute(routes=routes, near_road_share=share, bridged_m=bridged_m)


def spaced(xy_m: Array, spacing_m: float) -> Array:
    """Return points (M, 2) at most `spacing_m` apart along a line (N, 2), without its dithering.

    A point counts once it is `spacing_m` from the last one that did; longer legs are filled in.
    """
    kept = [xy_m[0]]
    for point in xy_m[1:]:
        leg = point - kept[-1]
        parts = int(np.hypot(leg[0], leg[1]) // spacing_m)
        if parts > 10_000:
            raise RouteError(f"route has a leg of {np.hypot(leg[0], leg[1]) / 1000:.0f} km")
        start = kept[-1]
        kept.extend(start + leg * (part / parts) for part in range(1, parts + 1))
    return np.asarray(kept)


def _near_share(roads: RoadIndex, xy: Array) -> float:
    return sum(bool(roads.near(point, NEAR_ROAD_M)) for point in xy) / len(xy)


@dataclass(frozen=True, slots=True)
class _Piece:
    """Connected edges matched to the line from point `first` to `last`."""

    edges: tuple[DirectedEdge, ...]
    first: int
    last: int


def _match_pieces(roads: RoadIndex, xy: Array) -> list[_Piece]:
    yaw = headings_rad(xy)
    layers: list[list[Hypothesis]] = []
    pieces: list[_Piece] = []
    first = 0
    for number, point in enumerate(xy):
        candidates = roads.near(point, NEAR_ROAD_M)
        if not candidates:
            pieces += _trace(layers, first)
            layers = []
            continue
        if layers:
            moved = float(np.hypot(*(point - xy[number - 1])))
            yaw_rad = float(yaw[number])
            layers.append(next_hypotheses(roads, layers[-1], candidates, yaw_rad, moved))
        else:
            first = number
            layers.append(first_hypotheses(candidates, float(yaw[number])))
    return pieces + _trace(layers, first)


def _trace(layers: Sequence[list[Hypothesis]], first: int) -> list[_Piece]:
    """Follow the best last hypothesis back to the beginning; cut where nothing connects."""
    if len(layers) < 2:
        return []
    chain: list[Hypothesis] = []
    place = 0
    for layer in reversed(layers):
        chain.append(layer[place])
        place = layer[place].parent
    chain.reverse()
    pieces: list[_Piece] = []
    visits = [_visit(chain[0].near)]
    start = first
    for number, hypothesis in enumerate(chain[1:], start=first + 1):
        step, last = hypothesis.near, visits[-1]
        if not hypothesis.connected:
            pieces.append(_Piece(tuple(without_spurs(visits)), start, number - 1))
            visits, start = [_visit(step)], number
        elif hypothesis.via or step.directed_edge.key != last.edge.key:
            visits += _driven_onto(last, hypothesis)
        last = visits[-1]
        last.to_m = max(last.to_m, step.s_m)
    # A line that ends on a node may have stepped onto the next road by nothing.
    if len(visits) > 1 and chain[-1].near.s_m < 2.0:
        visits.pop()
    pieces.append(_Piece(tuple(without_spurs(visits)), start, first + len(chain) - 1))
    return pieces


def _visit(near: NearEdge) -> EdgeVisit:
    return EdgeVisit(near.directed_edge, near.s_m, near.s_m)


def _driven_onto(last: EdgeVisit, hypothesis: Hypothesis) -> list[EdgeVisit]:
    """Return the visits after the last one, which is at its end unless the road was turned in."""
    step = hypothesis.near
    if not hypothesis.via and last.edge.turns_back(step.directed_edge):
        length_m = last.edge.edge.length_m
        last.to_m = max(last.to_m, length_m - step.s_m)
        return [EdgeVisit(step.directed_edge, length_m - last.to_m, step.s_m)]
    last.to_m = last.edge.edge.length_m
    through = [EdgeVisit(edge, 0.0, edge.edge.length_m) for edge in hypothesis.via]
    return [*through, EdgeVisit(step.directed_edge, 0.0, step.s_m)]


def _join(graph: RoadGraph, pieces: Sequence[_Piece]) -> tuple[tuple[Route, ...], float]:
    routes: list[list[DirectedEdge]] = []
    bridged_m = 0.0
    last = -1
    network: ShortestWays | None = None
    for piece in pieces:
        gap_m = (piece.first - last) * SPACING_M
        bridge = None
        if routes and gap_m <= BRIDGE_UP_TO_M:
            network = network or ShortestWays(graph)
            bridge = network.between(routes[-1][-1], piece.edges[0])
        length = sum(directed.edge.length_m for directed in bridge or ())
        # A way much longer than the line's own gap is not the one that was driven.
        if bridge is not None and length <= 1.3 * gap_m + 50.0:
            routes[-1] += [*bridge, *piece.edges]
            bridged_m += length
        else:
            routes.append(list(piece.edges))
        last = piece.last
    long_enough = [Route(tuple(edges)) for edges in routes]
    return tuple(route for route in long_enough if route.end_m >= 20.0), bridged_m
