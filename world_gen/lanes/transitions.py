"""Roads tagged `placement=transition`: their lanes lead from one road's place to the next one's."""

from __future__ import annotations

from collections.abc import Mapping

from foretwin.world_gen.lanes.cross_section import TRANSITION
from foretwin.world_gen.lanes.lane_plans import CrossSection
from foretwin.world_gen.lanes.legs import Cluster
from foretwin.world_gen.roads.road_graph import DirectedEdge, RoadEdge

_KEYS = ("placement", "placement:forward", "placement:backward")


def transition_shifts(
    clusters: tuple[Cluster, ...],
    edges: Mapping[int, RoadEdge],
    sections: Mapping[int, CrossSection],
) -> dict[int, tuple[float, float]]:
    """Return how far to the left of their way such roads begin and end, by edge index."""
    moving = {i for i, edge in edges.items() if any(edge.tags.get(k) == TRANSITION for k in _KEYS)}
    found = dict.fromkeys(moving, (0.0, 0.0))
    if not moving:
        return found
    for cluster in clusters:
        if not cluster.plain:
            continue
        for leg, other in (cluster.legs, cluster.legs[::-1]):
            index = leg.edge.index
            if index not in moving or other.edge.index in moving:
                continue
            shift = _shift_to(leg, sections[index], other, sections[other.edge.index])
            begin, end = found[index]
            found[index] = (begin, shift) if leg.reverse else (shift, end)
    return {i: shifts for i, shifts in found.items() if shifts != (0.0, 0.0)}


def _shift_to(
    leg: DirectedEdge, section: CrossSection, other: DirectedEdge, next_section: CrossSection
) -> float:
    """Return the smaller shift that lays one edge of the lanes upon that of the next road."""
    mine, its = _edges(section), _edges(next_section)
    if leg.reverse == other.reverse:  # the nodes of one run against those of the other
        its = (-its[1], -its[0])
    return min(its[0] - mine[0], its[1] - mine[1], key=abs)


def _edges(section: CrossSection) -> tuple[float, float]:
    cars = [lane for lane in section.lanes if lane.kind in ("driving", "bus")]
    first, last = cars[0], cars[-1]
    return first.left_m + first.width_m.value / 2, last.left_m - last.width_m.value / 2
