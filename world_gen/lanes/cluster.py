"""A cluster: where lanes end and begin, and which roads leave it."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import compress
from typing import NamedTuple

import msgspec
import numpy as np

from foretwin.world_gen.extent import Extent
from foretwin.world_gen.junctions.intersections import Junction
from foretwin.world_gen.junctions.map_index import MapIndex
from foretwin.world_gen.lanes.lane_plans import CrossSection
from foretwin.world_gen.lanes.legs import RING_KINDS, is_ring_edge
from foretwin.world_gen.lanes.past_driveways import JoinedRoads
from foretwin.world_gen.roads.road_graph import DirectedEdge, RoadEdge

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


class _ClusterNodes(NamedTuple):
    nodes: frozenset[int]
    inner: frozenset[int] = frozenset()
    junction: Junction | None = None
    whole: bool = False
    ring: bool = False


def clusters_of(
    index: MapIndex,
    made_for: tuple[Junction, ...],
    joined: JoinedRoads,
    edges: Mapping[int, RoadEdge],
    extent: Extent,
) -> tuple[Cluster, ...]:
    """Return the places where lanes of some edges end and begin, those of junctions first."""
    leaving: dict[int, list[DirectedEdge]] = {}
    for edge in edges.values():
        for directed in (DirectedEdge(edge, False), DirectedEdge(edge, True)):
            leaving.setdefault(directed.start_node, []).append(directed)
    known = list(leaving)
    at = np.array([leaving[node][0].xy_m[0] for node in known]).reshape(-1, 2)
    near: set[int] = {node for junction in made_for for node in junction.nodes}
    near.update(compress(known, extent.holds(at)))
    others = {j.summary.id: joined.junction(j) for j in made_for}
    for node in sorted(near):
        if found := index.junction_of_node.get(node):
            others.setdefault(found.summary.id, joined.junction(found))
    named = {j.summary.id for j in made_for}
    groups: list[_ClusterNodes] = []
    for junction in others.values():
        whole = junction.summary.id in named or (junction.nodes <= near and _drawn(junction, edges))
        groups.extend(_groups_of(junction, leaving, whole=whole))
    taken = frozenset().union(*(group.nodes for group in groups))
    groups.extend(_ClusterNodes(frozenset([n])) for n in sorted(near - taken))
    clusters = []
    for group in groups:
        out = (d for node in sorted(group.nodes) for d in leaving.get(node, ()))
        legs = tuple(d for d in out if d.edge.index not in group.inner)
        if len(legs) >= 2:
            clusters.append(Cluster(key=str(min(group.nodes)), legs=legs, **group._asdict()))
    return tuple(clusters)


def _drawn(junction: Junction, edges: Mapping[int, RoadEdge]) -> bool:
    """Return whether all roads of a junction that cars may use are among `edges`."""
    legs = (leg.edge for arm in junction.arms for leg in arm.outward)
    return all(edge.index in edges for edge in legs if edge.drivable)


def _groups_of(
    junction: Junction, leaving: Mapping[int, list[DirectedEdge]], *, whole: bool
) -> list[_ClusterNodes]:
    """A ring is driven node by node, every other junction in one go."""
    on_ring = {
        node for node in junction.nodes if any(is_ring_edge(d.edge) for d in leaving.get(node, ()))
    }
    if junction.summary.kind in RING_KINDS and on_ring:
        # Where a street parts into entry and exit before the ring, no car has to stop.
        places = ((frozenset([n]), n in on_ring) for n in sorted(junction.nodes))
        return [_ClusterNodes(n, frozenset(), junction, whole and on, on) for n, on in places]
    nodes = frozenset(node for node in junction.nodes if node in leaving)
    return [_ClusterNodes(nodes, frozenset(junction.inner), junction, whole)] if nodes else []
