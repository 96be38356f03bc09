"""Heights of roads over the World's plane: bridges rise and tunnels sink, with ramps to them."""

from __future__ import annotations

import heapq
from collections.abc import Mapping, Sequence

from foretwin.contracts.world import Road
from foretwin.geometry.polyline import length
from foretwin.world_gen.export.road_heights import LAYER_HEIGHT_M

RAMP_SLOPE = 0.06
"""Mean slope of a ramp (RASt 06: at most 6 to 8 % on main roads)."""
Node = str | tuple[str, bool]
"""A place, or a road's free end by its id and whether it is the end of its line."""


def node_of(road: Road, *, at_end: bool) -> Node:
    """Return what a road's end shares its height with."""
    place = road.to_place if at_end else road.from_place
    return place if place is not None else (road.id, at_end)


def heights_of(roads: Sequence[Road]) -> Mapping[Node, float]:
    """Return the heights in metres of all places and free ends.

    Roads of another layer than 0 lie level at their layer's height; from there roads come down,
    or up, with `RAMP_SLOPE`, over as many roads as that takes.
    """
    heights: dict[Node, float] = {}
    beside: dict[Node, list[tuple[Node, float]]] = {}
    for road in roads:
        ends = node_of(road, at_end=False), node_of(road, at_end=True)
        for node in ends:
            own = road.layer * LAYER_HEIGHT_M
            heights[node] = max(heights.get(node, 0.0), own, key=abs)
        along = length(road.reference_line)
        beside.setdefault(ends[0], []).append((ends[1], along))
        beside.setdefault(ends[1], []).append((ends[0], along))
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
