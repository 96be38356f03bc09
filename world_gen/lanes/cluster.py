"""A cluster: where lanes end and begin, and which roads leave it."""

from __future__ import annotations

from collections.abc import Mapping

import msgspec

from foretwin.world_gen.junctions.intersections import Junction
from foretwin.world_gen.lanes.lane_plans import CrossSection
from foretwin.world_gen.roads.road_graph import DirectedEdge

_SAME_WIDTH_M = 0.3
"""By no more may a lane's width change in one place: each of its edges then steps by half."""


class Cluster(msgspec.Struct, frozen=True, kw_only=True):
    """Graph nodes where lanes end and begin: one junction, one node of a ring, or a lone node.

    `legs` leave the cluster outward; `inner` edges lie within and have no lanes of their own.
    `whole` means that it belongs to a junction that lies whole in the World: such a junction
    gets stop lines, control and right of way.
    """

    key: str
    nodes: frozenset[int]
    inner: frozenset[int]
    legs: tuple[DirectedEdge, ...]
    junction: Junction | None
    whole: bool
    ring: bool

    @property
    def plain(self) -> bool:
        """Whether one road merely goes on here."""
        return len(self.legs) == 2 and len(self.nodes) == 1 and not self.whole

    def keeps_widths(self, sections: Mapping[int, CrossSection]) -> bool:
        """Return whether lanes keep their width where its first leg goes on in its second."""
        leg, other = self.legs[:2]
        mine, its = sections[leg.edge.index], sections[other.edge.index]
        return all(
            abs(a.width_m.value - b.width_m.value) <= _SAME_WIDTH_M
            for outward in (False, True)
            for a, b in zip(
                mine.along(reverse=leg.reverse == outward).abreast,
                its.along(reverse=other.reverse != outward).abreast,
                strict=False,
            )
        )
