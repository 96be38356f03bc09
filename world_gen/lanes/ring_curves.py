"""Rings as curves through the map's nodes: mappers draw them by a few points of a circle."""

from __future__ import annotations

import math
from collections.abc import Mapping

import msgspec
import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.geometry.polyline import length
from foretwin.geometry.splines import arcs_through
from foretwin.world_gen.lanes.legs import is_ring_edge
from foretwin.world_gen.roads.road_graph import RoadEdge

_STEP_RAD = math.radians(3.0)
"""What bends less from piece to piece stays as it is where bends of roads are rounded."""
_NOWHERE = np.array([np.nan, np.nan])


def ring_curves(edges: Mapping[int, RoadEdge]) -> dict[int, RoadEdge]:
    """Return the edges of rings with more points, all on a curve through the map's own.

    Points of our own have the node 0. A ring whose piece is missing, or that parts, is straight
    up to the first node beside the gap.
    """
    ring = {index: edge for index, edge in edges.items() if is_ring_edge(edge)}
    leaving: dict[int, list[RoadEdge]] = {}
    arriving: dict[int, list[RoadEdge]] = {}
    for edge in ring.values():
        leaving.setdefault(edge.start_node, []).append(edge)
        arriving.setdefault(edge.end_node, []).append(edge)
    return {
        index: _curved(
            edge,
            _next(arriving.get(edge.start_node, []), edge, at=-2),
            _next(leaving.get(edge.end_node, []), edge, at=1),
        )
        for index, edge in ring.items()
    }


def _next(beyond: list[RoadEdge], edge: RoadEdge, *, at: int) -> Array:
    """Return where a ring goes on beside an edge; NaN where that is not one road of its kind."""
    if len(beyond) != 1 or (beyond[0] is edge and len(edge.xy_m) < 4):
        return _NOWHERE
    point: Array = beyond[0].xy_m[at]
    return point


def _curved(edge: RoadEdge, before: Array, after: Array) -> RoadEdge:
    pieces = arcs_through(edge.xy_m, before, after, step_rad=_STEP_RAD)
    line = np.concatenate([edge.xy_m[:1], *(piece[1:] for piece in pieces)])
    own = [(0,) * (len(piece) - 2) for piece in pieces]
    nodes = (
        node for pair in zip(own, edge.node_ids[1:], strict=True) for node in (*pair[0], pair[1])
    )
    return msgspec.structs.replace(
        edge, xy_m=line, node_ids=(edge.node_ids[0], *nodes), length_m=length(line)
    )
