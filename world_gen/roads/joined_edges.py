"""Join short stretches of road to what they go on in, where a map parts them for no driver.

Mappers part a way where any tag or relation begins, a bus line say. How near to a junction that
is must not say how much room its turns have, or where its stop lines may lie.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import chain, groupby

import msgspec
import numpy as np

from foretwin.world_gen.roads.road_graph import RoadEdge

SHORT_M = 45.0
"""What is shorter may hold less than a junction needs of an approach: 30 m that lanes give way, and
the 15 m beside other roads that still belong to it (`lanes.trims`)."""
UNREAD = (
    *("name", "alt_name", "ref:", "wiki", "note", "description", "addr:", "fixme"),
    *("surface", "smoothness", "tracktype", "destination", "check_date", "survey:date"),
)
"""Keys that begin so have no meaning for how a road is driven; that it has a name does, and who
compares roads compares names apart."""


def joined(edges: Sequence[RoadEdge], kept_nodes: frozenset[int]) -> list[RoadEdge]:
    """Return edges, numbered anew, of which short ones are one with what they go on in.

    That is at nodes where two edges alone meet, head to tail, of the same name and the same tags
    but for those unread; never at `kept_nodes`. What would be a loop stays parted at its middle. A
    joined edge is of the way of its longest part.
    """
    after = _followers(edges, kept_nodes)
    behind = set(after.values())
    found: list[list[int]] = []
    for first in (i for i in range(len(edges)) if i not in behind):
        parts = [first]
        while parts[-1] in after:
            parts.append(after[parts[-1]])
        found.extend(_loop_parted(parts, edges))
    # Edges that are joined round and round have no first one.
    found.extend([i] for i in set(range(len(edges))).difference(chain.from_iterable(found)))
    return [one_edge([edges[i] for i in parts], index) for index, parts in enumerate(sorted(found))]


def _loop_parted(parts: list[int], edges: Sequence[RoadEdge]) -> list[list[int]]:
    if len(parts) == 1 or edges[parts[0]].start_node != edges[parts[-1]].end_node:
        return [parts]
    ends_m = np.cumsum([edges[i].length_m for i in parts])
    middle = 1 + int(np.abs(ends_m[:-1] - ends_m[-1] / 2.0).argmin())
    return [parts[:middle], parts[middle:]]


def _followers(edges: Sequence[RoadEdge], kept_nodes: frozenset[int]) -> dict[int, int]:
    """Return by the place of an edge in `edges` that of the one that it is to be joined with."""
    ends = np.array([(edge.start_node, edge.end_node) for edge in edges]).reshape(-1, 2)
    _, row, uses = np.unique(ends, return_inverse=True, return_counts=True)
    alone = (uses[row] == 2).reshape(-1, 2)
    begins = {edges[i].start_node: i for i in np.flatnonzero(alone[:, 0]).tolist()}
    found = {}
    for i in np.flatnonzero(alone[:, 1]).tolist():
        edge = edges[i]
        j = begins.get(edge.end_node)
        if j is None or j == i or edge.end_node in kept_nodes:
            continue
        if min(edge.length_m, edges[j].length_m) < SHORT_M and alike(edge, edges[j]):
            found[i] = j
    return found


def alike(edge: RoadEdge, other: RoadEdge) -> bool:
    """Return whether two roads have the same name and are driven alike by all their tags."""
    of_place = (edge.driving_side, edge.country) == (other.driving_side, other.country)
    return of_place and edge.name == other.name and read_tags(edge.tags) == read_tags(other.tags)


def read_tags(tags: Mapping[str, str]) -> dict[str, str]:
    """Return those tags of a way that may have a meaning for how it is driven."""
    return {key: value for key, value in tags.items() if not key.startswith(UNREAD)}


def one_edge(parts: Sequence[RoadEdge], index: int) -> RoadEdge:
    """Return edges that follow each other, head to tail, as one of this index."""
    if len(parts) == 1:
        only = parts[0]
        return only if only.index == index else msgspec.structs.replace(only, index=index)
    main = max(parts, key=lambda part: (part.length_m, -part.way_id))
    xy_m = np.concatenate([parts[0].xy_m, *(part.xy_m[1:] for part in parts[1:])])
    xy_m.setflags(write=False)
    ways = tuple(way for way, _ in groupby(chain.from_iterable(part.ways for part in parts)))
    return msgspec.structs.replace(
        main,
        index=index,
        part_ways=ways if len(ways) > 1 else (),
        start_node=parts[0].start_node,
        end_node=parts[-1].end_node,
        node_ids=(*parts[0].node_ids, *chain.from_iterable(p.node_ids[1:] for p in parts[1:])),
        xy_m=xy_m,
        length_m=sum([part.length_m for part in parts]),
    )
