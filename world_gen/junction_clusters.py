"""Which branchings of the road graph are one junction to a driver."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import combinations

from world_gen.chains import CarRoads, Chain, Ring
from world_gen.road_graph import RoadGraph

CLOSE_M = 20.0
"""Branchings so near each other are one junction, staggered perhaps."""
ISLAND_SIDE_M = 30.0
"""Traffic islands have no longer side."""
MEDIAN_M = 60.0
"""Carriageways of one street are no farther apart where another road crosses them."""
SIGNALLED_M = 45.0
"""Signalled branchings so near each other, with no signal between them, are one junction."""
STOP_LINE_M = 30.0
"""Signals stand no farther before the branching that they govern."""
FLARE_M = 80.0
"""Arms of a roundabout part into entry and exit no farther from it."""
SLIP_M, RAMP_SLIP_M = 70.0, 120.0
"""Length of a slip road around a corner, by any class and by a link class."""
WIDEST_M, WIDEST_WITH_SLIPS_M = 70.0, 170.0
"""A junction other than a ring is no wider, without and with its slip roads."""
THINNEST_CORNER_RAD = math.radians(18.0)


@dataclass(slots=True)
class Cluster:
    """Branchings of one junction; `core` without the far ends of flares and slip roads."""

    core: set[int]
    nodes: set[int]
    ring: Ring | None = None
    chains: set[tuple[int, int]] = field(default_factory=set)
    """Keys of the chains that joined it."""


def cluster_branchings(
    roads: CarRoads, graph: RoadGraph, signalled: frozenset[int]
) -> list[Cluster]:
    """Return the branchings and rings grouped into junctions, by their smallest node id.

    `signalled` are nodes with a traffic light. A group may still turn out to be no junction:
    a street that parts into its carriageways is a group with two arms.
    """
    grouping = _Grouping(roads, graph.node_xy_m)
    single = [chain for chains in roads.chains_from.values() for chain in chains]
    single = [chain for chain in single if chain.start <= chain.end and chain.start != chain.end]
    single.sort(key=lambda chain: (chain.length_m, chain.key))
    for chain in single:
        if chain.length_m > MEDIAN_M:
            break
        if (
            chain.length_m <= CLOSE_M
            or _links_carriageways(chain, roads)
            or _in_island(chain, roads)
            or (chain.length_m <= SIGNALLED_M and _one_signal(chain, roads, signalled))
        ):
            grouping.join(chain, WIDEST_M)
    _add_flares(grouping, roads)
    _add_slips(grouping, roads)
    return grouping.clusters()


class _Grouping:
    """Disjoint clusters by node; joining refuses what would grow too wide or hold two rings."""

    def __init__(self, roads: CarRoads, xy_m: Mapping[int, tuple[float, float]]) -> None:
        self.xy_m = xy_m
        self.of: dict[int, Cluster] = {}
        for ring in roads.rings:
            cluster = Cluster(core=set(ring.nodes), nodes=set(ring.nodes), ring=ring)
            for node in ring.nodes:
                # A node of two rings of different kinds stays with the first.
                self.of.setdefault(node, cluster)
        for node in roads.chains_from:
            if node not in self.of and len(roads.chains_from[node]) >= 2:
                self.of[node] = Cluster(core={node}, nodes={node})

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

    def attach(self, cluster: Cluster, other: Cluster, keys: tuple[tuple[int, int], ...]) -> bool:
        """Add another cluster's nodes to one without making them its core."""
        if cluster is other or other.ring:
            return False
        if not cluster.ring and self._width_m(cluster, other) > WIDEST_WITH_SLIPS_M:
            return False
        self._merge(cluster, other, keys)
        return True

    def _merge(self, a: Cluster, b: Cluster, keys: tuple[tuple[int, int], ...]) -> None:
        a.nodes |= b.nodes
        a.chains |= b.chains
        a.chains.update(keys)
        for node in b.nodes:
            self.of[node] = a

    def _width_m(self, a: Cluster, b: Cluster) -> float:
        return max(self.distance_m(m, n) for m in a.nodes for n in b.nodes)

    def distance_m(self, a: int, b: int) -> float:
        """Return metres between two nodes."""
        return math.dist(self.xy_m[a], self.xy_m[b])

    def clusters(self) -> list[Cluster]:
        """Return every cluster once, by smallest node id."""
        unique = {id(cluster): cluster for cluster in self.of.values()}
        return sorted(unique.values(), key=lambda cluster: min(cluster.core))


def _links_carriageways(chain: Chain, roads: CarRoads) -> bool:
    """Tell whether a chain leads from one carriageway of a street to the opposite one."""
    for name_a, heading_a in _carriageways(chain.start, chain, roads):
        for name_b, heading_b in _carriageways(chain.end, chain, roads):
            opposed = math.cos(heading_a - heading_b) < -0.64
            if name_a == name_b and opposed:
                return True
    return False


def _carriageways(node: int, besides: Chain, roads: CarRoads) -> Iterator[tuple[str, float]]:
    """Yield (name, heading) of the one-way streets that run straight through a node."""
    others = [chain for chain in roads.chains_from[node] if chain.key != besides.key]
    for into in others:
        if not (into.one_way and into.inward):
            continue
        heading = into.bearing_rad(15.0) + math.pi
        for out in others:
            if out.one_way and out.outward and out.name == into.name:
                ahead = out.bearing_rad(15.0)
                if math.cos(ahead - heading) > 0.64:
                    yield into.name, ahead


def _in_island(chain: Chain, roads: CarRoads) -> bool:
    """Tell whether a chain is a side of a traffic island: a ring of up to four short chains."""
    if chain.length_m > ISLAND_SIDE_M:
        return False
    waiting = [(chain.end, frozenset({chain.key}))]
    while waiting:
        node, used = waiting.pop()
        for side in roads.chains_from[node]:
            if side.length_m > ISLAND_SIDE_M or side.key in used:
                continue
            if side.end == chain.start:
                return True
            if len(used) < 3:
                waiting.append((side.end, used | {side.key}))
    return False


def _one_signal(chain: Chain, roads: CarRoads, signalled: frozenset[int]) -> bool:
    """Tell whether both ends of a chain are signalled and nothing stops a driver in between."""
    ends = (chain.start, chain.end)
    if any(node in signalled for node, _ in chain.nodes() if node not in ends):
        return False
    return all(_has_signal(node, chain, roads, signalled) for node in ends)


def _has_signal(node: int, besides: Chain, roads: CarRoads, signalled: frozenset[int]) -> bool:
    if node in signalled:
        return True
    for chain in roads.chains_from[node]:
        if chain.key == besides.key or not chain.inward:
            continue
        for passed, distance_m in chain.nodes():
            if distance_m > STOP_LINE_M:
                break
            if passed in signalled:
                return True
    return False


def _add_flares(grouping: _Grouping, roads: CarRoads) -> None:
    """Give each ring the nodes where its arms part into entry and exit."""
    for node, chains in roads.chains_from.items():
        own = grouping.of.get(node)
        if own is None or own.ring:
            continue
        for a, b in combinations(chains, 2):
            target = grouping.of.get(a.end)
            if (
                target is not None
                and target.ring
                and grouping.of.get(b.end) is target
                and a.one_way
                and b.one_way
                and a.outward != b.outward
                and max(a.length_m, b.length_m) <= FLARE_M
                and grouping.attach(target, own, (a.key, b.key))
            ):
                break


def _add_slips(grouping: _Grouping, roads: CarRoads) -> None:
    """Give junctions the ends of the slip roads that cut their corners."""
    slips = [
        chain
        for chains in roads.chains_from.values()
        for chain in chains
        if chain.one_way
        and chain.outward
        and chain.length_m <= (RAMP_SLIP_M if chain.link else SLIP_M)
    ]
    for slip in sorted(slips, key=lambda chain: (chain.length_m, chain.key)):
        a, b = grouping.of.get(slip.start), grouping.of.get(slip.end)
        if a is None or b is None or a is b:
            continue
        limit_m = RAMP_SLIP_M if slip.link else SLIP_M
        sides_a = _sides(a, slip, limit_m, grouping, roads)
        sides_b = _sides(b, slip, limit_m, grouping, roads)
        shared = [id(c) for c in (s[1] for s in sides_a.values()) if id(c) in sides_b]
        for corner_id in shared:
            chain_a, corner = sides_a[corner_id]
            chain_b, _ = sides_b[corner_id]
            if corner is a or corner is b:
                continue
            if _is_corner(
                grouping.xy_m[slip.start], grouping.xy_m[slip.end], grouping.xy_m[chain_a.end]
            ):
                grouping.attach(corner, a, (slip.key, chain_a.key))
                grouping.attach(corner, b, (slip.key, chain_b.key))
                break


def _sides(
    cluster: Cluster, slip: Chain, limit_m: float, grouping: _Grouping, roads: CarRoads
) -> dict[int, tuple[Chain, Cluster]]:
    """Return the clusters next to one along short roads, with the shortest such road."""
    found: dict[int, tuple[Chain, Cluster]] = {}
    for node in sorted(cluster.nodes):
        for chain in roads.chains_from.get(node, ()):
            other = grouping.of.get(chain.end)
            if chain.key == slip.key or other is None or chain.length_m > limit_m:
                continue
            known = found.get(id(other))
            if known is None or chain.length_m < known[0].length_m:
                found[id(other)] = (chain, other)
    return found


def _is_corner(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> bool:
    """Tell whether three points make a triangle without a very sharp corner."""
    for p, q, r in ((a, b, c), (b, c, a), (c, a, b)):
        first = math.atan2(q[1] - p[1], q[0] - p[0])
        second = math.atan2(r[1] - p[1], r[0] - p[0])
        if abs(math.remainder(first - second, math.tau)) < THINNEST_CORNER_RAD:
            return False
    return True
