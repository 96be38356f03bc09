"""The roads that meet a junction, counted as a driver does: a dual carriageway is one."""

from __future__ import annotations

import math
from itertools import combinations
from typing import NamedTuple

from foretwin.world_gen.junctions.chains import CarRoads, Chain
from foretwin.world_gen.junctions.grouping import JunctionCluster
from foretwin.world_gen.junctions.intersections import JunctionArm
from foretwin.world_gen.roads.road_graph import RoadGraph

LOOK_M = 30.0
"""How far along a road its direction and its distance from another are judged."""
CARRIAGEWAY_GAP_M = 62.0
OPPOSED_RAD, ALONGSIDE_RAD = math.radians(50.0), math.radians(25.0)
REJOIN_M = 90.0
"""Carriageways that part and meet again within this length are one road whatever their names."""
INSIDE_M = 15.0
"""A road between two nodes of a junction is inside it if it bulges no farther out."""


class ClusterRoads(NamedTuple):
    """The chains at a cluster: those inside it (one direction each) and those that leave it."""

    inside: tuple[Chain, ...]
    leaving: tuple[Chain, ...]


class ArmChains(NamedTuple):
    """One arm with the chains that make it, each leaving the junction."""

    arm: JunctionArm
    chains: tuple[Chain, ...]
    start_xy_m: tuple[float, float]


def roads_of(cluster: JunctionCluster, roads: CarRoads, graph: RoadGraph) -> ClusterRoads:
    """Split the chains at a cluster's nodes into those inside and those that leave it."""
    nodes = cluster.nodes
    if len(nodes) == 1 and not cluster.ring:
        (node,) = nodes
        chains = roads.chains_from[node]
        if node not in [chain.end for chain in chains]:
            return ClusterRoads(inside=(), leaving=chains)
    centre = graph.middle_of(nodes)
    reach_m = max([math.dist(graph.node_xy_m[node], centre) for node in nodes]) + INSIDE_M
    inside: dict[tuple[int, int], Chain] = {}
    leaving: list[Chain] = []
    for node in sorted(nodes):
        for chain in roads.chains_from.get(node, ()):
            within = chain.end in nodes and (
                chain.key in cluster.chains
                or all(
                    math.dist(point, centre) <= reach_m
                    for point in zip(chain.x_m, chain.y_m, strict=True)
                )
            )
            if within:
                inside.setdefault(chain.key, chain)
            else:
                leaving.append(chain)
    return ClusterRoads(inside=tuple(inside.values()), leaving=tuple(leaving))


def approaches(leaving: tuple[Chain, ...]) -> tuple[ArmChains, ...]:
    """Group the chains that leave a junction into its arms, by bearing from east."""
    ways_out = [_WayOut(chain, chain.bearing_rad(LOOK_M)) for chain in leaving]
    group = list(range(len(leaving)))
    one_way = [i for i, chain in enumerate(leaving) if chain.one_way]
    for i, j in combinations(one_way, 2):
        if _one_road(ways_out[i], ways_out[j]):
            group = [group[i] if g == group[j] else g for g in group]
    of_arm: dict[int, list[_WayOut]] = {}
    for label, way_out in zip(group, ways_out, strict=True):
        of_arm.setdefault(label, []).append(way_out)
    arms = [_approach(together) for together in of_arm.values()]
    arms.sort(key=lambda item: (item.arm.bearing_rad, item.chains[0].key))
    return tuple(arms)


class _WayOut(NamedTuple):
    """A chain that leaves a junction, and where it points."""

    chain: Chain
    bearing_rad: float


def _one_road(way_a: _WayOut, way_b: _WayOut) -> bool:
    """Tell whether two one-way chains are carriageways of one road."""
    a, b = way_a.chain, way_b.chain
    angle = abs(math.remainder(way_a.bearing_rad - way_b.bearing_rad, math.tau))
    if a.outward != b.outward:
        if a.end == b.end and max(a.length_m, b.length_m) <= REJOIN_M and angle < math.pi / 2:
            return True
        widest_rad = OPPOSED_RAD
    elif a.link == b.link:
        widest_rad = ALONGSIDE_RAD
    else:
        return False
    if angle > widest_rad or not _same_street(a, b):
        return False
    return math.dist(a.point_at(LOOK_M), b.point_at(LOOK_M)) <= CARRIAGEWAY_GAP_M


def _same_street(a: Chain, b: Chain) -> bool:
    if a.name or b.name:
        return a.name == b.name
    classes = (a.edges[0].edge.road_class, b.edges[0].edge.road_class)
    return classes[0].removesuffix("_link") == classes[1].removesuffix("_link")


def _approach(together: list[_WayOut]) -> ArmChains:
    chains = tuple([way_out.chain for way_out in together])
    x, y, east, north = 0.0, 0.0, 0.0, 0.0
    for chain, bearing_rad in together:
        x, y = x + chain.x_m[0], y + chain.y_m[0]
        east, north = east + math.cos(bearing_rad), north + math.sin(bearing_rad)
    return ArmChains(
        arm=JunctionArm(
            name=next((chain.name for chain in chains if chain.name), ""),
            bearing_rad=math.atan2(north, east),
            outward=tuple([chain.edges[0] for chain in chains]),
        ),
        chains=chains,
        start_xy_m=(x / len(chains), y / len(chains)),
    )
