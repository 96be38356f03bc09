"""The roads that leave a place where lanes meet: where they head, and which lanes lie where."""

from __future__ import annotations

import math
from collections.abc import Mapping

from foretwin.world_gen.lanes.lane_plans import CrossSection
from foretwin.world_gen.roads.headings import dot, heading_out
from foretwin.world_gen.roads.road_graph import DirectedEdge, EdgeKey, RoadEdge

_PARTED_M = 25.0
_BESIDE_COS = math.cos(math.radians(30.0))
RING_KINDS = ("roundabout", "circular")


def is_ring_edge(edge: RoadEdge) -> bool:
    """Return whether an edge is part of a roundabout's or other circular junction's ring."""
    return edge.tags.get("junction") in RING_KINDS


Heads = Mapping[EdgeKey, tuple[float, float]]
"""Unit directions in which legs leave, by (edge index, reverse)."""


def opposed(leg: DirectedEdge, other: DirectedEdge) -> bool:
    """Return whether two one-way roads leave a place side by side, as carriageways of a street."""
    if leg.edge.index == other.edge.index or not (leg.edge.one_way and other.edge.one_way):
        return False
    heads = ((heading_out(leg, m), heading_out(other, m)) for m in (8.0, _PARTED_M))
    return any(dot(mine, its) > _BESIDE_COS for mine, its in heads)


def lateral_positions(
    leg: DirectedEdge, section: CrossSection, *, outward: bool, shift_m: float = 0.0
) -> list[tuple[float, bool]]:
    """Return (metres left, driven that way) of car lanes, seen along or against an outward leg."""
    flip = leg.reverse == outward
    side = -1.0 if flip else 1.0
    found = [
        (round(side * (lane.left_m + shift_m), 3) + 0.0, lane.reverse == flip)
        for lane in section.lanes
        if lane.kind in ("driving", "bus")
    ]
    return sorted(found)
