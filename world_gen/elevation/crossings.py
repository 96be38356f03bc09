"""Where one road passes over another without meeting it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import shapely

from foretwin.world_gen.roads.road_graph import RoadEdge

LAYER_HEIGHT_M = 5.0
"""From one OSM layer to the next: a lorry's 4.5 m and a bridge deck."""


class Overpass(NamedTuple):
    """Two roads by their places in a list, how far along each, and how far apart in height."""

    above: int
    above_m: float
    below: int
    below_m: float
    clear_m: float


def crossings_of(edges: Sequence[RoadEdge]) -> list[Overpass]:
    """Return where roads of different layers cross in plan, but for those that share a node.

    However many layers are between, they say an order alone: a lorry's height is what is known.
    """
    lines = [shapely.LineString(edge.xy_m) for edge in edges]
    tree = shapely.STRtree(lines)
    found = []
    lifted = [i for i, edge in enumerate(edges) if edge.layer != 0]
    if not lifted:
        return []
    left, right = tree.query([lines[i] for i in lifted], predicate="crosses")
    pairs = {
        (min(lifted[a], b), max(lifted[a], b))
        for a, b in zip(left.tolist(), right.tolist(), strict=True)
    }
    for one, other in sorted(pairs):
        a, b = edges[one], edges[other]
        if a.layer == b.layer or {a.start_node, a.end_node} & {b.start_node, b.end_node}:
            continue
        above, below = (one, other) if a.layer > b.layer else (other, one)
        meeting = shapely.intersection(lines[one], lines[other])
        for point in shapely.get_parts(meeting):
            if point.geom_type == "Point":
                along = [float(shapely.line_locate_point(lines[i], point)) for i in (above, below)]
                found.append(Overpass(above, along[0], below, along[1], LAYER_HEIGHT_M))
    return found
