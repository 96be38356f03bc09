"""Disjoint groups of branchings that grow into junctions."""

from __future__ import annotations

import math
from collections.abc import Mapping

import msgspec

from foretwin.world_gen.junctions.chains import CarRoads, Chain, Ring


class JunctionCluster(msgspec.Struct):
    """Branchings of one junction; `core` without the far ends of flares and slip roads."""

    core: set[int]
    nodes: set[int]
    ring: Ring | None = None
    chains: set[tuple[int, int]] = msgspec.field(default_factory=set)
    """Keys of the chains that joined it."""


class Grouping:
    """Disjoint clusters by node; joining refuses what would grow too wide or hold two rings."""

    def __init__(self, roads: CarRoads, xy_m: Mapping[int, tuple[float, float]]) -> None:
        self.xy_m = xy_m
        self.of: dict[int, JunctionCluster] = {}
        for ring in roads.rings:
            cluster = JunctionCluster(core=set(ring.nodes), nodes=set(ring.nodes), ring=ring)
            for node in ring.nodes:
                # A node of two rings of different kinds stays with the first.
                self.of.setdefault(node, cluster)
        for node in roads.chains_from:
            if node not in self.of and len(roads.chains_from[node]) >= 2:
                self.of[node] = JunctionCluster(core={node}, nodes={node})

    def join(self, chain: Chain, widest_m: float) -> None:
        """Make one core of the two ends of a chain, unless one is a ring's."""
        a, b = self.of.get(chain.start), self.of.get(chain.end)
        if a is None or b is None:
            return
        if a is b:
            a.chains.add(chain.key)
            return
        if a.ring or b.ring or self._width_m(a, b) > widest_m:
            return
        a.core |= b.core
        self._merge(a, b, (chain.key,))

    def attach(
        self,
        cluster: JunctionCluster,
        other: JunctionCluster,
        keys: tuple[tuple[int, int], ...],
        *,
        widest_m: float = math.inf,
        core: bool = False,
    ) -> bool:
        """Add another cluster's nodes to one, with `core` to its core too; False where refused."""
        if cluster is other or other.ring:
            return False
        if self._width_m(cluster, other) > widest_m:
            return False
        if core and not cluster.ring:
            cluster.core |= other.core
        self._merge(cluster, other, keys)
        return True

    def _merge(
        self, a: JunctionCluster, b: JunctionCluster, keys: tuple[tuple[int, int], ...]
    ) -> None:
        a.nodes |= b.nodes
        a.chains |= b.chains
        a.chains.update(keys)
        for node in b.nodes:
            self.of[node] = a

    def _width_m(self, a: JunctionCluster, b: JunctionCluster) -> float:
        return max(self.distance_m(m, n) for m in a.nodes for n in b.nodes)

    def distance_m(self, a: int, b: int) -> float:
        """Return metres between two nodes."""
        return math.dist(self.xy_m[a], self.xy_m[b])

    def clusters(self) -> list[JunctionCluster]:
        """Return every cluster once, by smallest node id."""
        unique = {id(cluster): cluster for cluster in self.of.values()}
        return sorted(unique.values(), key=lambda cluster: min(cluster.core))
