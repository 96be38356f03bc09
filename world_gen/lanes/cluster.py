"""A cluster: where lanes end and begin, and which roads leave it."""

from __future__ import annotations

import msgspec

from foretwin.world_gen.junctions.intersections import Junction
from foretwin.world_gen.roads.road_graph import DirectedEdge


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
