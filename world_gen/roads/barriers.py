"""Where something that stands on a road closes it to cars, and roads that end before it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping, Sequence

import msgspec
import numpy as np
import numpy.typing as npt

from foretwin.geometry.polyline import arc_lengths, points_at
from foretwin.world_gen.osm.osm_map import OsmWay
from foretwin.world_gen.roads.road_graph import RoadEdge
from foretwin.world_gen.roads.road_tags import directions, is_car_road, open_to_cars

NO_CAR_PASSES = frozenset(
    {
        *("block", "bollard", "jersey_barrier", "planter", "log", "debris"),
        *("cycle_barrier", "motorcycle_barrier", "bus_trap", "sump_buster"),
        *("kissing_gate", "stile", "horse_stile", "turnstile", "full-height_turnstile"),
    }
)
"""Values of `barrier` that keep cars out where no access tag says otherwise; gates are open then
(https://wiki.openstreetmap.org/wiki/Key:barrier)."""
STANDS_BACK_M = 1.0
"""Roads end so far before what closes them: half of a block, and the room that lanes keep."""


def closes_to_cars(tags: Mapping[str, str]) -> bool:
    """Tell whether what stands at a node keeps cars of the public from passing.

    Access tags decide, the most specific first; a bollard that sinks opens to somebody.
    """
    if "barrier" not in tags:
        return False
    stands = tags["barrier"] in NO_CAR_PASSES and tags.get("bollard") != "rising"
    return not open_to_cars({"access": "no", **tags} if stands else tags)


def closed_nodes(
    ways: Sequence[tuple[OsmWay, tuple[int, ...]]],
    nodes: npt.NDArray[np.int64],
    node_tags: Mapping[int, Mapping[str, str]],
) -> frozenset[int]:
    """Return the nodes at which roads for cars are closed; those of the ways stand in `nodes`.

    That is within a road or at its end. Where more roads meet, or one on which no car may drive,
    a map does not tell which of them is closed: such a node is none.
    """
    closing = [node for node, tags in node_tags.items() if closes_to_cars(tags)]
    rows = np.flatnonzero(np.isin(nodes, closing))
    first = np.cumsum([0, *(len(path) for _, path in ways)])
    of_way = np.searchsorted(first, rows, "right") - 1
    ends: Counter[int] = Counter()
    of_cars: Counter[int] = Counter()
    for row, i in zip(rows.tolist(), of_way.tolist(), strict=True):
        node, tags = int(nodes[row]), ways[i][0].tags
        count = 2 - (row == first[i]) - (row == first[i + 1] - 1)
        ends[node] += count
        if is_car_road(tags) and any(directions(tags)):
            of_cars[node] += count
    found = (node for node in ends if of_cars[node] == ends[node] <= 2)
    return frozenset(node for node in found if not (nodes == -node).any())


def ended_before(edges: Sequence[RoadEdge], closed: Collection[int]) -> list[RoadEdge]:
    """Return edges that end before the nodes `closed`, at each of which two of them end at most.

    Theirs are two nodes then, one of which is the negative of the other.
    """
    if not closed:
        return list(edges)
    taken: set[int] = set()

    def end_of(node: int) -> int:
        if node not in closed:
            return node
        if node in taken:
            return -node
        taken.add(node)
        return node

    def ended(edge: RoadEdge) -> RoadEdge:
        shut = [node in closed for node in (edge.start_node, edge.end_node)]
        if not any(shut):
            return edge
        back_m = min(STANDS_BACK_M, edge.length_m / 4.0)
        begin_m, to_m = back_m * shut[0], edge.length_m - back_m * shut[1]
        along_m = arc_lengths(edge.xy_m)
        kept = np.flatnonzero((along_m > begin_m) & (along_m < to_m))
        ends = points_at(edge.xy_m, np.array([begin_m, to_m]))
        xy_m = np.concatenate([ends[:1], edge.xy_m[kept], ends[1:]])
        xy_m.setflags(write=False)
        start, end = end_of(edge.start_node), end_of(edge.end_node)
        return msgspec.structs.replace(
            edge,
            start_node=start,
            end_node=end,
            node_ids=(start, *(edge.node_ids[i] for i in kept), end),
            xy_m=xy_m,
            length_m=to_m - begin_m,
        )

    return [ended(edge) for edge in edges]
