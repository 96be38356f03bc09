"""The whole map and the route as a viewer draws them, from the road graph."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
import shapely

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import LocalFrame, target_from_source_m
from foretwin.contracts.roads_shown import RoadsShown, StreetName
from foretwin.orchestrator.routing.route import Route
from foretwin.world_gen.roads.road_graph import RoadEdge, RoadGraph

MOST_ROADS = 20_000
"""Of a large city the nearest: more costs a viewer memory and shows nothing more."""
MOST_NAMES = 120
NAMED_WITHIN_M = 80.0
"""Streets that the route follows or crosses have their names written."""


def roads_shown(graph: RoadGraph, routes: Sequence[Route], drive_frame: LocalFrame) -> RoadsShown:
    """Return the roads for cars in the drive's frame, the nearest to its way where there are more
    than `MOST_ROADS`; without a route, to where the drive begins."""
    ways = [_line(route) for route in routes if route.edges]
    lines = tuple(_moved(ways, graph.frame, drive_frame))
    edges = [edge for edge in graph.edges if edge.drivable]
    moved = _moved([edge.xy_m for edge in edges], graph.frame, drive_frame)
    near = shapely.MultiLineString(list(lines)) if lines else shapely.Point(0.0, 0.0)
    away_m = np.array([near.distance(shapely.LineString(line)) for line in moved])
    by_distance = np.argsort(away_m, kind="stable")
    kept = [moved[index] for index in np.sort(by_distance[:MOST_ROADS])]
    named = [i for i in by_distance if away_m[i] <= NAMED_WITHIN_M]
    return RoadsShown(
        xy_m=np.concatenate(kept) if kept else np.empty((0, 2)),
        counts=np.array([len(line) for line in kept], dtype=np.int64),
        routes=lines,
        names=tuple(_names([(edges[i], moved[i]) for i in named])) if lines else (),
    )


def _line(route: Route) -> Array:
    return route.line(0, len(route.edges) - 1)


def _moved(lines: Sequence[Array], source: LocalFrame, target: LocalFrame) -> list[Array]:
    """Move many lines with one projection."""
    if not lines:
        return []
    moved = target_from_source_m(target, source, np.concatenate(lines))
    return np.split(moved, np.cumsum([len(line) for line in lines])[:-1])


def _names(roads: Iterable[tuple[RoadEdge, Array]]) -> Iterable[StreetName]:
    """Yield each name once, in the middle of its longest stretch."""
    longest: dict[str, tuple[RoadEdge, Array]] = {}
    for edge, line in roads:
        known = longest.get(edge.name)
        if not edge.name or (known is None and len(longest) >= MOST_NAMES):
            continue
        if known is None or edge.length_m > known[0].length_m:
            longest[edge.name] = (edge, line)
    for name, (_, line) in longest.items():
        middle = shapely.LineString(line).interpolate(0.5, normalized=True)
        yield StreetName(name=name, x_m=middle.x, y_m=middle.y)
