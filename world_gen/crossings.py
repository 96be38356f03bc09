"""Pedestrian crossings, from kerb to kerb at their nodes on the road."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from contracts.provenance import Choice, Quantity
from contracts.world import Crossing
from world_gen.beside_roads import BesideRoads
from world_gen.clusters import Surroundings
from world_gen.polyline import arc_lengths, direction_at, left_of

CROSSING_WIDTH_M = 4.0
_MARKED = ("zebra", "marked", "uncontrolled", "traffic_signals")


def crossings(
    around: Surroundings,
    node_tags: Mapping[int, Mapping[str, str]],
    beside: BesideRoads | None = None,
) -> tuple[Crossing, ...]:
    """Return each crossing node on a car road within the World, once.

    A node is one by its own tags, or since a way tagged as a crossing (`beside`) meets the road.
    """
    found: dict[int, Crossing] = {}
    drawn = beside.crossed_at if beside is not None else {}
    amid = {n for c in around.clusters if len(c.legs) > 2 for n in c.nodes} if drawn else set()
    for index, edge in sorted(around.edges.items()):
        for i, node in enumerate(edge.node_ids[: len(edge.xy_m)]):
            tags = node_tags.get(node)
            if tags is None or not (tags.get("highway") == "crossing" or "crossing" in tags):
                way = drawn.get(node)
                if way is None or node in amid:
                    continue
                tags = {**way.tags, **(tags or {})}
            at = edge.xy_m[i]
            if tags.get("crossing") == "no" or node in found:
                continue
            if not around.extent.holds(at[None])[0]:
                continue
            section = around.sections[index]
            along = float(arc_lengths(edge.xy_m)[i])
            left = left_of(direction_at(edge.xy_m, along))
            line = np.stack([at + left * section.left_m, at + left * section.right_m])
            found[node] = Crossing(
                id=f"n{node}",
                line=np.round(line, 3),
                width_m=Quantity(CROSSING_WIDTH_M, "default"),
                kind=_kind(tags),
                osm_node=node,
                island=tags.get("crossing:island") == "yes",
            )
    return tuple(found[node] for node in sorted(found))


def _kind(tags: Mapping[str, str]) -> Choice:
    marks = tags.get("crossing:markings") or tags.get("crossing_ref")
    word = tags.get("crossing")
    if word == "traffic_signals" or tags.get("crossing:signals") == "yes":
        return Choice("traffic_signals", "tagged")
    if marks == "zebra" or word == "zebra":
        return Choice("zebra", "tagged")
    if word in ("unmarked", "informal") or marks == "no":
        return Choice("unmarked", "tagged")
    if word in _MARKED or (marks and marks != "no"):
        return Choice("marked", "tagged")
    return Choice("unmarked", "default")
