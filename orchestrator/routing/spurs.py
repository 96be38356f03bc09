"""Metres of a line that turn back: those of its dithering, and of a corner that it cuts."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise

from foretwin.orchestrator.routing.edge_parts import TURN_BACK_M, part_of
from foretwin.world_gen.roads.road_graph import DirectedEdge


@dataclass(slots=True)
class EdgeVisit:
    """An edge that a line follows, from where to where on it."""

    edge: DirectedEdge
    from_m: float
    to_m: float
    beyond_m: float = 0.0
    """How far into the edges after it a spur went that was left out."""

    @property
    def driven_m(self) -> float:
        """How far was driven on it and beyond."""
        return self.to_m - self.from_m + self.beyond_m

    @property
    def is_short(self) -> bool:
        """Whether nobody needed to turn back for it: no farther than that takes room."""
        return self.driven_m <= TURN_BACK_M


def without_spurs(visits: Iterable[EdgeVisit]) -> list[DirectedEdge]:
    """Return the edges of visits without those that are left for some metres by turning back.

    Where a road is driven back from between its nodes, its edges end and begin there.
    """
    kept: list[EdgeVisit] = []
    for visit in visits:
        kept.append(visit)
        while len(kept) > 2 and _turns_back(*kept[-3:-1]):
            there, back, after = kept[-3:]
            if _turns_back(back, after) and back.is_short:
                kept[-3:] = [EdgeVisit(there.edge, there.from_m, after.to_m, after.beyond_m)]
            elif len(kept) > 3 and there.is_short and back.is_short:
                kept[-4].beyond_m += there.driven_m
                del kept[-3:-1]
            else:
                break
    if len(kept) > 1 and _turns_back(*kept[:2]) and kept[0].is_short:
        del kept[0]
    if len(kept) > 1 and _turns_back(*kept[-2:]) and kept[-1].is_short:
        del kept[-1]
    for there, back in pairwise(kept):
        if _turns_back(there, back) and there.to_m > there.edge.edge.length_m - TURN_BACK_M:
            there.to_m, back.from_m = there.edge.edge.length_m, 0.0
    kept[0].from_m, kept[-1].to_m = 0.0, kept[-1].edge.edge.length_m
    return [part_of(visit.edge, visit.from_m, visit.to_m) for visit in kept]


def _turns_back(one: EdgeVisit, other: EdgeVisit) -> bool:
    return one.edge.turns_back(other.edge)
