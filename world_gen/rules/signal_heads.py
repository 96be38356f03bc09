"""Signal heads: where each light hangs that governs a group of lanes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.provenance import Provenance
from foretwin.contracts.signals import Signal
from foretwin.contracts.world import DrivingSide, StopLine
from foretwin.world_gen.lanes.clusters import Surroundings
from foretwin.world_gen.lanes.lane_curves import LaneDraft
from foretwin.world_gen.roads.road_graph import EdgeKey
from foretwin.world_gen.rules.signal_groups import LaneGroup

BESIDE_HEIGHT_M, ABOVE_HEIGHT_M = 3.0, 5.5
"""Middle of a head on a post beside the road, and of one over the lanes (RiLSA 2015 6.2.3)."""
BESIDE_M = 0.6
WIDE_LANES = 3
"""Roads with as many lanes in have a head above the lanes as well."""


def signal_heads(
    groups: Sequence[LaneGroup], lines: Mapping[str, StopLine], around: Surroundings
) -> tuple[Signal, ...]:
    """Return the heads of every lane group, at its stop line.

    `lines` are by lane. The group next to the kerb has a head beside the road; one that is not,
    and any group of a wide road, a head above its lanes.
    """
    driving_side = around.driving_side
    by_road: dict[EdgeKey, list[LaneDraft]] = {}
    for group in groups:
        by_road.setdefault(group.approach.key, []).extend(group.lanes)
    heads: list[Signal] = []
    for group in groups:
        mine = by_road[group.approach.key]
        kerb_side = nearest_kerb(group.lanes, driving_side)
        at_kerb = kerb_side is nearest_kerb(mine, driving_side)
        yaw_rad = towards_drivers_rad(lines[kerb_side.id].ends)
        if at_kerb:
            place = beside(lines[kerb_side.id].ends, to_kerb_m(kerb_side, around), driving_side)
            heads.append(_head(f"{kerb_side.id}:signal", group, place, BESIDE_HEIGHT_M, yaw_rad))
        if not at_kerb or len(mine) >= WIDE_LANES:
            ends = np.concatenate([lines[lane.id].ends for lane in group.lanes])
            name = f"{kerb_side.id}:signal-above"
            heads.append(_head(name, group, ends.mean(axis=0), ABOVE_HEIGHT_M, yaw_rad))
    return tuple(heads)


def nearest_kerb(lanes: Sequence[LaneDraft], driving_side: DrivingSide) -> LaneDraft:
    """Return the lane of one direction that lies outermost on the side that traffic keeps."""
    sign = 1.0 if driving_side == "right" else -1.0
    return min(
        lanes, key=lambda n: -sign * n.plan.left_m if n.key.reverse else sign * n.plan.left_m
    )


def to_kerb_m(lane: LaneDraft, around: Surroundings) -> float:
    """Return how far a lane's outer edge lies from the carriageway's, on the side kept to."""
    section = around.sections[lane.key.edge]
    half_m = lane.width_m.value / 2.0
    if (around.driving_side == "right") != lane.key.reverse:
        return max(lane.plan.left_m - half_m - section.right_m, 0.0)
    return max(section.left_m - lane.plan.left_m - half_m, 0.0)


def beside(ends: Array, to_kerb_m: float, driving_side: DrivingSide) -> Array:
    """Return the place (2,) beside the road at a stop line."""
    outer, inner = (ends[1], ends[0]) if driving_side == "right" else (ends[0], ends[1])
    gap = outer - inner
    place: Array = outer + gap / max(math.hypot(*gap), 1e-6) * (to_kerb_m + BESIDE_M)
    return place


def towards_drivers_rad(ends: Array) -> float:
    """Return where a head at a stop line faces; `ends` (2, 2) stand from left to right."""
    right = ends[1] - ends[0]
    return round(math.atan2(-right[0], right[1]) + 0.0, 4)


def _head(name: str, group: LaneGroup, place: Array, height_m: float, yaw_rad: float) -> Signal:
    nodes = group.approach.signal_nodes
    source: Provenance = group.approach.control.source
    return Signal(
        id=name,
        osm_node=nodes[0] if nodes else None,
        group_id=group.id,
        lane_ids=tuple(lane.id for lane in group.lanes),
        position=np.round(np.array([place[0], place[1], height_m]), 3),
        yaw_rad=yaw_rad,
        source=source,
        osm_nodes=nodes,
    )
