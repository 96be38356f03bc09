"""Where one-way roads part or merge at a flat angle: how far the branch lies in the other road."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Mapping

import numpy as np
import shapely

from foretwin.geometry.polyline_batch import Polylines, cut, without_repeats
from foretwin.world_gen.lanes.cluster import Cluster
from foretwin.world_gen.lanes.lane_plans import CrossSection
from foretwin.world_gen.lanes.legs import Heads, is_ring_edge
from foretwin.world_gen.roads.headings import dot
from foretwin.world_gen.roads.road_graph import DirectedEdge, EdgeKey

LOOK_M = 300.0
"""A branch that has not left the other road by then runs beside it, closer than its lanes are
wide: what the map says of both, and no fork's doing."""
_STEP_M = 1.0
FLAT_COS = 0.7
"""Branches part at less than 45 degrees; others cross the kerb of the road and are cut there."""


def fork_trims(
    clusters: Iterable[Cluster], sections: Mapping[int, CrossSection], heads: Heads
) -> dict[EdgeKey, float]:
    """Return metres cut off branches, by (edge index, at its end node).

    Maps draw a ramp from the middle of the road that it leaves. Its lanes begin where they lie
    beside that road; what is between is driven along connections.
    """
    pairs = [pair for cluster in clusters for pair in _branches(cluster, heads)]
    if not pairs:
        return {}
    legs = [leg for pair in pairs for leg in pair]
    lines = without_repeats(Polylines.of([leg.xy_m for leg in legs]))
    lines = cut(lines, np.zeros(len(lines)), np.minimum(lines.length_m, LOOK_M))
    ways = shapely.linestrings(lines.xy_m, indices=lines.line)
    branches, roads = ways[::2], ways[1::2]
    found: dict[EdgeKey, float] = {}
    for (branch, road), line, other in zip(pairs, branches, roads, strict=True):
        room_m = sum(sections[leg.edge.index].half_width_m for leg in (branch, road))
        at_m = np.arange(0.0, line.length, _STEP_M)
        clear = shapely.distance(shapely.line_interpolate_point(line, at_m), other) >= room_m
        if clear.any():
            reach_m = float(at_m[np.argmax(clear)])
        elif line.length < LOOK_M:
            reach_m = line.length
        else:
            continue
        found[branch.key] = max(found.get(branch.key, 0.0), reach_m)
    return found


def _branches(cluster: Cluster, heads: Heads) -> Iterator[tuple[DirectedEdge, DirectedEdge]]:
    """Yield legs that part or merge at one node: the one that bends more, and the other.

    Where no road lies before them, the one of fewer lanes is the branch, or the shorter one.
    """
    one_way = [leg for leg in cluster.legs if leg.edge.one_way and not is_ring_edge(leg.edge)]
    for pair in itertools.combinations(one_way, 2):
        if pair[0].start_node != pair[1].start_node or _leaves(pair[0]) != _leaves(pair[1]):
            continue
        first, second = (heads[leg.key] for leg in pair)
        if dot(first, second) < FLAT_COS:
            continue
        others = [heads[leg.key] for leg in cluster.legs if leg not in pair]
        road, branch = sorted(
            pair,
            key=lambda leg: (
                min((dot(heads[leg.key], other) for other in others), default=0.0),
                -leg.lanes.value - leg.back.lanes.value,
                -leg.edge.length_m,
            ),
        )
        yield branch, road


def _leaves(leg: DirectedEdge) -> bool:
    return leg.edge.forward != leg.reverse
