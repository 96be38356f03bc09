"""The lanes and connections of a World that run along the path of a route.

A lane does where it is of the route's way, in its direction, and near the path; a connection where
it joins two such lanes. What is not driven as the map allows has no lanes in a World.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import target_from_source_m
from foretwin.contracts.world import World
from foretwin.geometry.polyline import densified, headings_rad
from foretwin.orchestrator.routing.driving_path import turn_radii
from foretwin.orchestrator.routing.edge_parts import whole
from foretwin.orchestrator.routing.rounding import FINE_M, TURN_ROUND_M
from foretwin.orchestrator.routing.route import Route
from foretwin.world_gen.lanes.past_driveways import past_driveway
from foretwin.world_gen.roads.joined_edges import SHORT_M
from foretwin.world_gen.roads.road_graph import DirectedEdge, EdgeKey, RoadGraph

BESIDE_M = 15.0
"""A lane farther from the route's path than this is no lane of its road."""
AHEAD_RAD = math.radians(60.0)
"""One that heads farther aside is not driven along the route."""
EDGE_SLACK_M = 25.0
"""A lane may begin and end so far from where its road does in the graph: junctions cut lanes."""


class Piece(NamedTuple):
    """A lane or connection: its line (N, 2) about 0.5 m apart and where that heads (N,), and the
    road that it belongs to.

    `road` is the way and whether it is driven against its nodes, None of connections, whose lanes
    are `joins`. `after` and `beside` name what follows and the lanes that it may be left for.
    """

    id: str
    xy_m: Array
    heading_rad: Array
    road: tuple[int, bool] | None
    joins: tuple[str, ...]
    after: tuple[str, ...]
    beside: tuple[str, ...]


class Followed(NamedTuple):
    """A piece beside a path: its points (N, 2) and the path's s (N,) there, rising."""

    piece: Piece
    xy_m: Array
    s_m: Array
    aside_m: float
    """Mean distance from the path."""

    @property
    def begin_m(self) -> float:
        """Where on the path it begins."""
        return float(self.s_m[0])

    @property
    def end_m(self) -> float:
        """Where on the path it ends."""
        return float(self.s_m[-1])


class WorldLanes:
    """The lanes of a World that cars drive, in the road graph's frame."""

    def __init__(self, world: World, graph: RoadGraph) -> None:
        def line(xy_m: Array) -> tuple[Array, Array]:
            moved = target_from_source_m(graph.frame, world.frame, xy_m)
            fine = densified(moved, spacing_m=FINE_M)
            return fine, headings_rad(fine)

        self.world_id = world.id
        self._graph = graph
        self._roads: dict[EdgeKey, frozenset[tuple[int, bool]]] = {}
        self.turn_radii_m = turn_radii(world.intersection.driving_side)
        pieces = {}
        for lane in world.lanes:
            if lane.kind != "driving" or len(lane.centerline) < 2:
                continue
            left = lane.left_id if lane.change in ("both", "left") else None
            right = lane.right_id if lane.change in ("both", "right") else None
            beside = tuple(name for name in (left, right) if name is not None)
            road = (lane.osm_way, lane.reverse)
            pieces[lane.id] = Piece(
                lane.id, *line(lane.centerline), road, (), lane.successor_ids, beside
            )
        for one in world.connections:
            if one.from_lane_id in pieces and one.to_lane_id in pieces:
                joins = one.from_lane_id, one.to_lane_id
                pieces[one.id] = Piece(
                    one.id, *line(one.centerline), None, joins, (one.to_lane_id,), ()
                )
        self._pieces = tuple(pieces.values())

    def beside(self, route: Route, xy_m: Array, s_m: Array) -> list[Followed]:
        """Return the lanes and connections along a path (N, 2) of `route`, with its s (N,)."""
        tree, heading = cKDTree(xy_m), headings_rad(xy_m)
        first, last = route.index_at(float(s_m[0])), route.index_at(float(s_m[-1]))
        spans: dict[tuple[int, bool], list[tuple[float, float]]] = {}
        for number in range(first, last + 1):
            edge = route.edges[number]
            begin, end = float(route.start_m[number]), float(route.start_m[number + 1])
            # Who turns back in the road swings out of its lanes there.
            if number > first and route.edges[number - 1].turns_back(edge):
                begin += EDGE_SLACK_M + TURN_ROUND_M
            if number < last and edge.turns_back(route.edges[number + 1]):
                end -= EDGE_SLACK_M + TURN_ROUND_M
            for road in self._roads_of(edge):
                spans.setdefault(road, []).append((begin, end))
        found = {}
        for piece in self._pieces:
            if piece.road is not None and piece.road in spans:
                one = _followed(piece, tree, heading, s_m, spans[piece.road])
                if one is not None:
                    found[piece.id] = one
        for piece in self._pieces:
            if piece.road is None and all(name in found for name in piece.joins):
                one = _followed(piece, tree, heading, s_m, None)
                if one is not None:
                    found[piece.id] = one
        return list(found.values())

    def _roads_of(self, edge: DirectedEdge) -> frozenset[tuple[int, bool]]:
        """Return of which ways its lanes may be, with whether they are driven against its nodes.

        Past driveways a World's lane goes on into the next way, and is of one of them.
        """
        if edge.key not in self._roads:
            ways = {edge.edge.way_id}
            for here in (whole(edge), whole(edge.back)):
                beyond_m = 0.0
                while beyond_m < SHORT_M and (ahead := past_driveway(self._graph, here)):
                    ways.add(ahead.edge.way_id)
                    beyond_m, here = beyond_m + ahead.edge.length_m, ahead
            self._roads[edge.key] = frozenset((way, edge.reverse) for way in ways)
        return self._roads[edge.key]


def _followed(
    piece: Piece,
    tree: cKDTree,
    heading: Array,
    s_m: Array,
    spans: Sequence[tuple[float, float]] | None,
) -> Followed | None:
    """Return the part of a piece that runs along the path; None where it has none."""
    away, nearest = tree.query(piece.xy_m, distance_upper_bound=BESIDE_M)
    along = (nearest > 0) & (nearest < len(s_m) - 1)
    nearest = np.minimum(nearest, len(s_m) - 1)
    if spans is not None:
        turned = piece.heading_rad - heading[nearest]
        along &= np.cos(turned) > math.cos(AHEAD_RAD)
        at = s_m[nearest]
        along &= np.any(
            [(at > a - EDGE_SLACK_M) & (at < b + EDGE_SLACK_M) for a, b in spans], axis=0
        )
    if not along.any():
        return None
    first, last = int(along.argmax()), len(along) - int(along[::-1].argmax())
    # Points that lie abreast of one and the same point of the path tell nothing more of it.
    risen = np.maximum.accumulate(s_m[nearest[first:last]])
    keep = np.concatenate([[True], np.diff(risen) > 1e-6])
    if not along[first:last].all():
        return None
    return Followed(
        piece, piece.xy_m[first:last][keep], risen[keep], float(away[first:last].mean())
    )
