"""Pedestrian crossings, from kerb to kerb at their nodes on the road."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.provenance import Choice, Quantity
from foretwin.contracts.world import Crossing
from foretwin.geometry.polyline import left_of, unit
from foretwin.world_gen.lanes.clusters import Surroundings
from foretwin.world_gen.lanes.stopping import CROSSING_WIDTH_M
from foretwin.world_gen.roads.beside_roads import BesideRoads
from foretwin.world_gen.roads.road_tags import is_crossed

_MARKED = ("zebra", "marked", "uncontrolled", "traffic_signals")


def crossings(
    around: Surroundings, node_tags: Mapping[int, Mapping[str, str]], beside: BesideRoads
) -> tuple[Crossing, ...]:
    """Return each crossing node on a car road within the World, once.

    A node is one by its own tags, or since a way tagged as a crossing (`beside`) meets the road.
    """
    places: dict[int, tuple[int, int, Mapping[str, str]]] = {}
    drawn = beside.crossed_at
    amid = {n for c in around.clusters if len(c.legs) > 2 for n in c.nodes} if drawn else set()
    for index, edge in sorted(around.edges.items()):
        for i, node in enumerate(edge.node_ids[: len(edge.xy_m)]):
            tags = node_tags.get(node)
            if tags is None or not is_crossed(tags):
                way = drawn.get(node)
                if way is None or node in amid:
                    continue
                tags = {**way.tags, **(tags or {})}
            if tags.get("crossing") != "no":
                places.setdefault(node, (index, i, tags))
    if not places:
        return ()
    nodes = sorted(places)
    on = [(around.edges[index].xy_m, i) for index, i, _ in map(places.__getitem__, nodes)]
    sections = [around.sections[places[node][0]] for node in nodes]
    at = np.array([xy[i] for xy, i in on])
    left = left_of(np.array([_ahead(xy, i) for xy, i in on]))
    kerbs_m = np.array([(section.left_m, section.right_m) for section in sections])
    lines = np.round(at[:, None] + left[:, None] * kerbs_m[:, :, None], 3)
    return tuple(
        Crossing(
            id=f"n{node}",
            line=line,
            width_m=Quantity(CROSSING_WIDTH_M, "default"),
            kind=_kind(places[node][2]),
            osm_node=node,
            island=places[node][2].get("crossing:island") == "yes",
        )
        for node, line, within in zip(nodes, lines, around.extent.holds(at).tolist(), strict=True)
        if within
    )


def _ahead(xy_m: Array, i: int) -> Array:
    """Return the unit direction (2,) in which a way (N, 2) leaves its point `i`."""
    last = len(xy_m) - 2
    i = min(i, last)
    while i < last and (xy_m[i + 1] == xy_m[i]).all():
        i += 1
    return unit(xy_m[i + 1] - xy_m[i])


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
