"""Where a map joins roads that pass over each other."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from foretwin.world_gen.osm.osm_map import OsmWay
from foretwin.world_gen.roads.road_tags import in_tunnel, on_bridge, road_layer


def passed_over(
    ways: Sequence[tuple[OsmWay, tuple[int, ...]]], nodes: npt.NDArray[np.int64]
) -> frozenset[int]:
    """Return the nodes that two ways of different levels share, though neither ends there.

    The ways' nodes stand one after the other in `nodes`. One of the two is a bridge or a tunnel:
    what passes below or above has no way to it, and the map joins them by mistake (a tunnel in
    Monaco lies 100 m below the boulevard). Where one of them ends, as a tunnel does at its mouth,
    or a third goes on, roads do meet.
    """
    lifted = [on_bridge(way.tags) or in_tunnel(way.tags) for way, _ in ways]
    if not any(lifted):
        return frozenset()
    lengths = [len(path) for _, path in ways]
    spans = np.repeat(lifted, lengths)
    layer = np.repeat([road_layer(way.tags) for way, _ in ways], lengths)
    last = np.cumsum(lengths) - 1
    goes_on = np.ones(len(nodes), dtype=bool)
    goes_on[last] = goes_on[last - np.array(lengths) + 1] = False
    order = np.argsort(nodes, kind="stable")
    begins = np.flatnonzero(np.diff(nodes[order], prepend=nodes[order[0]] - 1))
    shared_by_two = begins[np.diff(begins, append=len(order)) == 2]
    one, other = order[shared_by_two], order[shared_by_two + 1]
    over = goes_on[one] & goes_on[other] & (layer[one] != layer[other])
    return frozenset(nodes[one[over & (spans[one] | spans[other])]].tolist())
