"""Pedestrian crossings, from kerb to kerb at their nodes on the road."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.provenance import Choice, Quantity
from foretwin.contracts.world import Crossing
from foretwin.geometry.polyline import left_of, unit
from foretwin.world_gen.lanes.clusters import Surroundings
from foretwin.world_gen.lanes.stopping import CROSSING_WIDTH_M
from foretwin.world_gen.roads.beside_roads import BesideRoads
from foretwin.world_gen.roads.road_tags import is_crossed

_GOES_ON_COS = math.cos(math.radians(120.0))
"""A road goes on into another one that bends from it by less than 60°."""
_MARKED = ("zebra", "marked", "uncontrolled", "traffic_signals")


def crossings(
    around: Surroundings, node_tags: Mapping[int, Mapping[str, str]], beside: BesideRoads
) -> tuple[Crossing, ...]:
    """Return each crossing node on a car road within the World, once.

    A node is one by its own tags, or since a way tagged as a crossing (`beside`) meets the road.
    """
    places: dict[int, list[tuple[int, int]]] = {}
    tagged: dict[int, Mapping[str, str]] = {}
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
                places.setdefault(node, []).append((index, i))
                tagged[node] = tags
    if not places:
        return ()
    nodes = sorted(places)
    across = [_across(places[node], around) for node in nodes]
    at = np.array([found.at for found in across])
    left = left_of(np.array([found.along for found in across]))
    kerbs_m = np.array([found.kerbs_m for found in across])
    lines = np.round(at[:, None] + left[:, None] * kerbs_m[:, :, None], 3)
    return tuple(
        Crossing(
            id=f"n{node}",
            line=line,
            width_m=Quantity(CROSSING_WIDTH_M, "default"),
            kind=_kind(tagged[node]),
            osm_node=node,
            island=tagged[node].get("crossing:island") == "yes",
        )
        for node, line, within in zip(nodes, lines, around.extent.holds(at).tolist(), strict=True)
        if within
    )


class _Crossed(NamedTuple):
    """A road where it is crossed: the place and its direction there, both (2,), and how far to
    the left its kerbs lie."""

    at: Array
    along: Array
    kerbs_m: tuple[float, float]


def _across(ends: list[tuple[int, int]], around: Surroundings) -> _Crossed:
    """Return the road at a node by the edges that pass it, each with its point there.

    Of several it is the widest. It runs as the middle of the two pieces that meet at the node:
    how the map cuts a road into ways, and how these run, changes nothing.
    """

    def widest(end: tuple[int, int]) -> tuple[float, int, int]:
        section = around.sections[end[0]]
        return (round(section.right_m - section.left_m, 3), around.edges[end[0]].way_id, end[0])

    index, i = min(ends, key=widest)
    line, section = around.edges[index].xy_m, around.sections[index]
    behind, ahead = _step(line, i, -1), _step(line, i, 1)
    if behind is None and ahead is not None:
        behind = _going_on(ahead, ends, around)
    elif ahead is None and behind is not None:
        ahead = _going_on(behind, ends, around)
    along = np.zeros(2) if ahead is None else ahead
    along = along if behind is None else along - behind
    return _Crossed(line[i], unit(along), (section.left_m, section.right_m))


def _going_on(step: Array, ends: list[tuple[int, int]], around: Surroundings) -> Array | None:
    """Return the direction in which a road that leaves a node by `step` goes on behind it."""
    lines = [(around.edges[index].xy_m, i) for index, i in ends]
    steps = [_step(line, i, way) for line, i in lines for way in (-1, 1)]
    on = [other for other in steps if other is not None and other @ step < _GOES_ON_COS]
    return min(on, key=lambda other: float(other @ step), default=None)


def _step(xy_m: Array, i: int, way: int) -> Array | None:
    """Return the unit direction (2,) in which a line (N, 2) leaves its point `i`, ahead or back."""
    k = i + way
    while 0 <= k < len(xy_m):
        if (xy_m[k] != xy_m[i]).any():
            return unit(xy_m[k] - xy_m[i])
        k += way
    return None


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
