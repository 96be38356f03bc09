"""Heights of roads and lanes over the World's plane: bridges rise and tunnels sink, with ramps."""

from __future__ import annotations

import heapq
from collections import defaultdict
from collections.abc import Mapping, Sequence

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.elevation import Elevation, HeightProfile
from foretwin.contracts.world import Road, World
from foretwin.geometry.polyline import length
from foretwin.geometry.world_heights import WorldHeights
from foretwin.world_gen.elevation.crossings import LAYER_HEIGHT_M

RAMP_SLOPE = 0.06
"""Mean slope of a ramp (RASt 06: at most 6 to 8 % on main roads)."""
Node = str | tuple[str, bool]
"""A place, or a road's free end by its id and whether it is the end of its line."""


def layered(world: World) -> WorldHeights | None:
    """Return heights of a World without an elevation: those of layers; None where all is level."""
    if not any(road.layer for road in world.roads):
        return None
    at = layer_heights(world.roads)
    roads = {road.id: road for road in world.roads}
    lanes = {lane.id: lane for lane in world.lanes}

    def end_m(lane_id: str, *, last: bool) -> float:
        lane = lanes[lane_id]
        return at[node_of(roads[lane.road_id], at_end=last != lane.reverse)]

    flat = Elevation(
        source="layers",
        base_m=0.0,
        grade_std=0.0,
        roads=tuple(
            _rise(r.id, r.reference_line, *(at[node_of(r, at_end=last)] for last in (False, True)))
            for r in world.roads
        ),
        connections=tuple(
            _rise(
                c.id,
                c.centerline,
                end_m(c.from_lane_id, last=True),
                end_m(c.to_lane_id, last=False),
            )
            for c in world.connections
        ),
        ground_from_m=(0.0, 0.0),
        ground_step_m=1.0,
        ground_m=np.zeros((2, 2)),
    )
    return WorldHeights(world, flat)


def _rise(name: str, line: Array, start_m: float, end_m: float) -> HeightProfile:
    """Return a change of height that is level at both ends."""
    along_m = np.array([0.0, length(line)])
    return HeightProfile(
        id=name, along_m=along_m, height_m=np.array([start_m, end_m]), grade=np.zeros(2)
    )


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
