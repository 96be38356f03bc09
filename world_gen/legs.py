"""The roads that leave a place where lanes meet: where they head, and which lanes lie where."""

from __future__ import annotations

import math

import numpy as np

from contracts.arrays import Array
from world_gen.cross_section import CrossSection
from world_gen.polyline import direction_at, unit, without_repeats
from world_gen.road_graph import DirectedEdge, RoadEdge

RING_KINDS = ("roundabout", "circular")


def is_ring_edge(edge: RoadEdge) -> bool:
    """Return whether an edge is part of a roundabout's or other circular junction's ring."""
    return edge.tags.get("junction") in RING_KINDS


def heading_out(leg: DirectedEdge, look_m: float = 8.0) -> Array:
    """Return the unit direction (2,) in which a leg leaves, averaged over `look_m`."""
    xy = without_repeats(leg.xy_m)
    steps = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(xy, axis=0).T))])
    reach = min(look_m, float(steps[-1]))
    target = np.array([np.interp(reach, steps, xy[:, 0]), np.interp(reach, steps, xy[:, 1])])
    gap = target - xy[0]
    return unit(gap) if math.hypot(*gap) > 0.1 else direction_at(xy, 0.0)


def lateral_positions(
    leg: DirectedEdge, section: CrossSection, *, outward: bool, shift_m: float = 0.0
) -> list[tuple[float, bool]]:
    """Return (metres left, driven that way) of car lanes, seen along or against an outward leg."""
    flip = leg.reverse == outward
    side = -1.0 if flip else 1.0
    found = [
        (round(side * (lane.left_m + shift_m), 2) + 0.0, lane.reverse == flip)
        for lane in section.lanes
        if lane.kind in ("driving", "bus")
    ]
    return sorted(found)
