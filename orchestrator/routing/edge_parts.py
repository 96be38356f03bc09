"""Parts of edges: what a route drives of a road in which it turns back, between two nodes."""

from __future__ import annotations

import msgspec

from foretwin.geometry.polyline import arc_lengths, cut
from foretwin.world_gen.roads.road_graph import DirectedEdge, RoadEdge

TURNED_NODE = 0
"""Id of a part's end that is no node of the map: no junction is there, and no road leads on."""

TURN_BACK_M = 25.0
"""Room to turn back: a turning circle of 12 m, or a mouth to back into. Chosen."""


class EdgePart(RoadEdge, frozen=True, kw_only=True):
    """A part of the edge `whole`, of the same index; it begins `from_m` along the nodes of that."""

    whole: RoadEdge
    from_m: float


def part_of(directed: DirectedEdge, from_m: float, to_m: float) -> DirectedEdge:
    """Return what is driven of an edge between two positions along it, in driving direction."""
    edge = directed.edge
    if directed.reverse:
        from_m, to_m = edge.length_m - to_m, edge.length_m - from_m
    if from_m <= 0.0 and to_m >= edge.length_m:
        return directed
    along = zip(edge.node_ids[1:-1], arc_lengths(edge.xy_m)[1:-1], strict=True)
    start = edge.start_node if from_m <= 0.0 else TURNED_NODE
    end = edge.end_node if to_m >= edge.length_m else TURNED_NODE
    inner = (node for node, at_m in along if from_m + 1e-6 < at_m < to_m - 1e-6)
    fields = msgspec.structs.asdict(edge) | {
        "start_node": start,
        "end_node": end,
        "node_ids": (start, *inner, end),
        "xy_m": cut(edge.xy_m, from_m, to_m),
        "length_m": to_m - from_m,
    }
    return DirectedEdge(EdgePart(**fields, whole=edge, from_m=from_m), directed.reverse)


def whole(directed: DirectedEdge) -> DirectedEdge:
    """Return the edge of the graph that a route's edge is, or is a part of."""
    edge = directed.edge
    return DirectedEdge(edge.whole, directed.reverse) if isinstance(edge, EdgePart) else directed


def begins_m(directed: DirectedEdge) -> float:
    """Return how far along its whole edge a route's edge begins, in driving direction."""
    edge = directed.edge
    if not isinstance(edge, EdgePart):
        return 0.0
    return edge.whole.length_m - edge.from_m - edge.length_m if directed.reverse else edge.from_m


def place_on(directed: DirectedEdge, s_m: float) -> float | None:
    """Return where on a route's edge a position on its whole edge lies; None beside a part of it.

    Nobody turns back to a metre: a little beyond a part is at the end of it.
    """
    if not isinstance(directed.edge, EdgePart):
        return s_m
    at_m, most_m = s_m - begins_m(directed), directed.edge.length_m
    beside = not -TURN_BACK_M < at_m < most_m + TURN_BACK_M
    return None if beside else min(max(at_m, 0.0), most_m)
