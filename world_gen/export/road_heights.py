"""Heights of roads and lanes over the World's plane: bridges rise and tunnels sink, with ramps."""

from __future__ import annotations

import heapq
from collections import defaultdict
from collections.abc import Mapping, Sequence

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.world import Connection, Lane, Road, World
from foretwin.geometry.polyline import arc_lengths, length
from foretwin.world_gen.elevation.crossings import LAYER_HEIGHT_M
from foretwin.world_gen.export.lane_borders import Borders

RAMP_SLOPE = 0.06
"""Mean slope of a ramp (RASt 06: at most 6 to 8 % on main roads)."""
Node = str | tuple[str, bool]
"""A place, or a road's free end by its id and whether it is the end of its line."""


class RoadHeights:
    """Heights at the ends of lanes, shared by all that meet there; ramps run between them."""

    def __init__(self, world: World, borders: Mapping[str, Borders]) -> None:
        self._at: dict[tuple[int, int], float] = {}
        parts: list[Lane | Connection] = [*world.lanes, *world.connections]
        for part in parts:
            if part.layer == 0 or part.id not in borders:
                continue
            height = part.layer * LAYER_HEIGHT_M
            for line in borders[part.id]:
                for key in _keys(line):
                    self._at[key] = max(self._at.get(key, 0.0), height, key=abs)

    def along(self, line: Array, layer: int) -> Array:
        """Return heights (N,) of a border (N, 2) in metres.

        A lane of another layer than 0 lies level; one of layer 0 rises or falls evenly between
        the heights at its ends.
        """
        if not self._at:
            return np.zeros(len(line))
        first, last = (self._at.get(key, 0.0) for key in _keys(line))
        s = arc_lengths(line)
        heights: Array = first + (last - first) * s / max(float(s[-1]), 1e-6)
        if layer != 0:
            heights[1:-1] = layer * LAYER_HEIGHT_M
        return heights


def _keys(line: Array) -> tuple[tuple[int, int], tuple[int, int]]:
    (x0, y0), (x1, y1) = np.rint(line[[0, -1]] * 1000.0).astype(np.int64).tolist()
    return (x0, y0), (x1, y1)


def node_of(road: Road, *, at_end: bool) -> Node:
    """Return what a road's end shares its height with."""
    place = road.to_place if at_end else road.from_place
    return place if place is not None else (road.id, at_end)


def layer_heights(roads: Sequence[Road]) -> Mapping[Node, float]:
    """Return the heights in metres of all places and free ends.

    Roads of another layer than 0 lie level at their layer's height; from there roads come down,
    or up, with `RAMP_SLOPE`, over as many roads as that takes.
    """
    heights: dict[Node, float] = {}
    beside: dict[Node, list[tuple[Node, float]]] = defaultdict(list)
    for road in roads:
        ends = node_of(road, at_end=False), node_of(road, at_end=True)
        along = length(road.reference_line)
        for node, other in (ends, ends[::-1]):
            own = road.layer * LAYER_HEIGHT_M
            heights[node] = max(heights.get(node, 0.0), own, key=abs)
            beside[node].append((other, along))
    level = {node for node, height in heights.items() if height != 0.0}
    queue = [(-abs(heights[node]), str(node), node) for node in level]
    heapq.heapify(queue)
    while queue:
        high, _, node = heapq.heappop(queue)
        if -high < abs(heights[node]):
            continue
        for other, along in beside[node]:
            left = abs(heights[node]) - RAMP_SLOPE * along
            if other not in level and left > abs(heights[other]):
                heights[other] = left if heights[node] > 0.0 else -left
                heapq.heappush(queue, (-left, str(other), other))
    return heights
