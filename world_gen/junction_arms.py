"""The roads that meet a junction, counted as a driver does: a dual carriageway is one."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import combinations

from world_gen.chains import CarRoads, Chain
from world_gen.grouping import Cluster
from world_gen.intersections import JunctionArm
from world_gen.road_graph import RoadGraph

LOOK_M = 30.0
"""How far along a road its direction and its distance from another are judged."""
CARRIAGEWAY_GAP_M = 62.0
OPPOSED_RAD, ALONGSIDE_RAD = math.radians(50.0), math.radians(25.0)
REJOIN_M = 90.0
"""Carriageways that part and meet again within this length are one road whatever their names."""
INSIDE_M = 15.0
"""A road between two nodes of a junction is inside it if it bulges no farther out."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ClusterRoads:
    """The chains at a cluster: those inside it (one direction each) and those that leave it."""

    inside: tuple[Chain, ...]
    leaving: tuple[Chain, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Approach:
    """One arm with the chains that make it, each leaving the junction."""

    arm: JunctionArm
    chains: tuple[Chain, ...]
    start_xy_m: tuple[float, float]


def roads_of(cluster: Cluster, roads: CarRoads, graph: RoadGraph) -> ClusterRoads:
    """Split the chains at a cluster's nodes into those inside and those that leave it."""
    points = [graph.node_xy_m[node] for node in sorted(cluster.nodes)]
    centre = (
        sum(x for x, _ in points) / len(points),
        sum(y for _, y in points) / len(points),
    )
    reach_m = max(math.dist(point, centre) for point in points) + INSIDE_M
    inside: dict[tuple[int, int], Chain] = {}
    leaving: list[Chain] = []
    for node in sorted(cluster.nodes):
        for chain in roads.chains_from.get(node, ()):
            within = chain.end in cluster.nodes and (
                chain.key in cluster.chains
                or all(math.dist(point, centre) <= reach_m for point in chain.points())
            )
            if within:
                inside.setdefault(chain.key, chain)
            else:
                leaving.append(chain)
    return ClusterRoads(inside=tuple(inside.values()), leaving=tuple(leaving))


def approaches(leaving: tuple[Chain, ...]) -> tuple[Approach, ...]:
    """Group the chains that leave a junction into its arms, by bearing from east."""
    group = list(range(len(leaving)))
    for i, j in combinations(range(len(leaving)), 2):
        if _one_road(leaving[i], leaving[j]):
            group = [group[i] if g == group[j] else g for g in group]
    arms = [
        _approach(tuple(chain for chain, g in zip(leaving, group, strict=True) if g == label))
        for label in dict.fromkeys(group)
    ]
    return tuple(sorted(arms, key=lambda item: (item.arm.bearing_rad, item.chains[0].key)))


def _one_road(a: Chain, b: Chain) -> bool:
    if not (a.one_way and b.one_way):
        return False
    angle = abs(math.remainder(a.bearing_rad(LOOK_M) - b.bearing_rad(LOOK_M), math.tau))
    if a.outward != b.outward:
        if a.end == b.end and max(a.length_m, b.length_m) <= REJOIN_M and angle < math.pi / 2:
            return True
        widest_rad = OPPOSED_RAD
    elif a.link == b.link:
        widest_rad = ALONGSIDE_RAD
    else:
        return False
    gap_m = math.dist(a.point_at(LOOK_M), b.point_at(LOOK_M))
    return _same_street(a, b) and angle <= widest_rad and gap_m <= CARRIAGEWAY_GAP_M


def _same_street(a: Chain, b: Chain) -> bool:
    if a.name or b.name:
        return a.name == b.name
    classes = (a.edges[0].edge.road_class, b.edges[0].edge.road_class)
    return classes[0].removesuffix("_link") == classes[1].removesuffix("_link")


def _approach(chains: tuple[Chain, ...]) -> Approach:
    x_m = sum(math.cos(chain.bearing_rad(LOOK_M)) for chain in chains)
    y_m = sum(math.sin(chain.bearing_rad(LOOK_M)) for chain in chains)
    starts = [next(chain.points()) for chain in chains]
    return Approach(
        arm=JunctionArm(
            name=next((chain.name for chain in chains if chain.name), ""),
            bearing_rad=math.atan2(y_m, x_m),
            outward=tuple(chain.edges[0] for chain in chains),
        ),
        chains=chains,
        start_xy_m=(
            sum(x for x, _ in starts) / len(starts),
            sum(y for _, y in starts) / len(starts),
        ),
    )
