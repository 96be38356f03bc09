"""The roads of the map that a connection is driven along, found without what laid its path."""

from __future__ import annotations

import heapq
import itertools
import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import shapely
import shapely.ops

from foretwin.contracts.frames import LocalFrame, local_from_geo
from foretwin.contracts.world import Lane
from foretwin.world_gen.roads.road_graph import RoadGraph

FARTHEST_M = 150.0
"""Of roads between two lanes; no place is wider."""
_RINGS = ("roundabout", "circular")
LEAST_M = 0.5
"""A shorter piece has no direction that one would drive in."""


class _Along(NamedTuple):
    """An edge as it is driven."""

    start_node: int
    end_node: int
    xy_m: np.ndarray
    ring: bool


class _Piece(NamedTuple):
    """A road of the map; `ring` where it is part of a circular junction."""

    xy_m: np.ndarray
    ring: bool


class RoadsDriven:
    """Answers along which pieces of a map's roads one comes from lane to lane."""

    def __init__(self, graph: RoadGraph, frame: LocalFrame) -> None:
        """Index the edges, in a World's frame, by their way and nodes, and by where they end."""
        self._by_name: dict[tuple[int, int, int], list[_Piece]] = {}
        self._onward: dict[int, list[tuple[int, _Piece, float]]] = {}
        origin = graph.frame.origin
        moved_m = local_from_geo(frame, np.array([origin.lat_deg]), np.array([origin.lon_deg]))
        for edge in graph.edges:
            line, ring = edge.xy_m + moved_m, edge.tags.get("junction") in _RINGS
            for a, b, xy_m, allowed in (
                (edge.start_node, edge.end_node, line, edge.forward),
                (edge.end_node, edge.start_node, line[::-1], edge.backward),
            ):
                if allowed and edge.car:
                    piece = _Piece(xy_m, ring)
                    self._by_name.setdefault((edge.way_id, a, b), []).append(piece)
                    self._onward.setdefault(a, []).append((b, piece, edge.length_m))

    def lines(self, start: Lane, end: Lane) -> list[np.ndarray]:
        """Return the roads (N, 2) from the end of one lane to another, piece by piece.

        They are the shortest way between the nodes at the ends of both lanes' edges, between what
        the lanes leave of these edges, which may be a point.
        """
        first, last = self._edge_of(start), self._edge_of(end)
        return [
            _left_of_it(first.xy_m, start.centerline[-1], behind=True),
            *(piece.xy_m for piece in self._between(first.end_node, last.start_node)),
            _left_of_it(last.xy_m, end.centerline[0], behind=False),
        ]

    def by_ring(self, start: Lane, end: Lane) -> bool:
        """Whether one comes from lane to lane by a circular junction."""
        first, last = self._edge_of(start), self._edge_of(end)
        between = self._between(first.end_node, last.start_node)
        return first.ring or last.ring or any(piece.ring for piece in between)

    def directions(self, start: Lane, end: Lane) -> Iterator[np.ndarray]:
        """Yield the direction (2,) of each piece of road from the end of one lane to another."""
        for line in self.lines(start, end):
            yield from np.diff(line, axis=0)

    def _edge_of(self, lane: Lane) -> _Along:
        way, start, end, side = lane.id.split(".")
        nodes = int(start), int(end)
        a, b = nodes if side[0] == "f" else nodes[::-1]
        beside = shapely.LineString(lane.centerline)
        named = self._by_name.get((int(way[1:]), a, b), [])
        # A way may lead from node to node twice.
        pieces = sorted(named, key=lambda one: _aside_m(one, beside))[:1]
        if not pieces:  # past driveways a World's road is of several edges
            pieces = self._between(a, b, farthest_m=math.inf, beside=beside)
        line = np.concatenate([one.xy_m for one in pieces])
        return _Along(a, b, line, any(one.ring for one in pieces))

    def _between(
        self,
        start: int,
        end: int,
        *,
        farthest_m: float = FARTHEST_M,
        beside: shapely.LineString | None = None,
    ) -> list[_Piece]:
        """Return the shortest way from node to node; the farther its roads are from the line
        `beside`, the longer they count."""
        order = itertools.count()
        heap: list[tuple[float, int, int, list[_Piece]]] = [(0.0, next(order), start, [])]
        seen: set[int] = set()
        while heap:
            at_m, _, node, lines = heapq.heappop(heap)
            if node == end:
                return lines
            if node in seen or at_m > farthest_m:
                continue
            seen.add(node)
            for other, piece, length_m in self._onward.get(node, ()):
                if other not in seen:
                    aside_m = 0.0 if beside is None else _aside_m(piece, beside)
                    to_m = at_m + length_m * (1.0 + aside_m)
                    heapq.heappush(heap, (to_m, next(order), other, [*lines, piece]))
        return []


def _aside_m(piece: _Piece, line: shapely.LineString) -> float:
    """Return how far the middle of a piece of road lies beside a line."""
    middle = shapely.LineString(piece.xy_m).interpolate(0.5, normalized=True)
    return float(middle.distance(line))


def _left_of_it(xy_m: np.ndarray, at: np.ndarray, *, behind: bool) -> np.ndarray:
    """Return what is left of a road behind, or before, where a lane ends, or begins."""
    road = shapely.LineString(xy_m)
    at_m = road.project(shapely.Point(at))
    part = shapely.ops.substring(road, *((at_m, road.length) if behind else (0.0, at_m)))
    return np.array(part.coords if part.length > LEAST_M else part.coords[:1])
