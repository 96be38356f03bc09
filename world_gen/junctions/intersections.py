"""Junctions as a driver sees them, and which of them a route passes."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import msgspec

from foretwin.contracts.arrays import Array
from foretwin.contracts.world import IntersectionSummary
from foretwin.world_gen.roads.road_graph import DirectedEdge


class JunctionArm(msgspec.Struct, frozen=True, kw_only=True):
    """One road that meets a junction.

    `outward` are the directed edges that leave the junction's nodes along this road, whichever
    way cars may drive them: one for a street, two for a dual carriageway.
    """

    name: str
    bearing_rad: float
    outward: tuple[DirectedEdge, ...]


class Junction(msgspec.Struct, frozen=True, kw_only=True):
    """One junction: `nodes` are all OSM graph nodes inside it, `inner` the edges between them."""

    summary: IntersectionSummary
    centre_xy_m: Array
    nodes: frozenset[int]
    inner: tuple[int, ...]
    """Indices of the edges inside the junction (ring, short links between carriageways)."""
    arms: tuple[JunctionArm, ...]
    radius_m: float
    """Distance from the centre to the farthest node of the junction."""
    lights: frozenset[int] = frozenset()
    """OSM nodes of the traffic lights that stop who comes in or drives within."""


class JunctionPassage(NamedTuple):
    """A junction on a route and the index of the route's edge that enters it, or ends in it."""

    junction: Junction
    edge_index: int


def junctions_on_route(
    junctions: Iterable[Junction], directed_edges: Sequence[DirectedEdge]
) -> list[JunctionPassage]:
    """Return the junctions that a route drives through, in order, once for every passage.

    A route passes a junction when it comes to one of its nodes. The opposite carriageway of a
    road with a junction on one carriageway alone has no node in it and passes by. A route that
    begins in a junction passes it only if it returns.
    """
    at_node = {node: junction for junction in junctions for node in junction.nodes}
    passages: list[JunctionPassage] = []
    inside: Junction | None = None
    if directed_edges:
        inside = at_node.get(directed_edges[0].start_node)
    for index, item in enumerate(directed_edges):
        here = at_node.get(item.end_node)
        stays = here is inside and here is not None and item.edge.index in here.inner
        if here is not None and not stays:
            passages.append(JunctionPassage(here, index))
        inside = here
    return passages
