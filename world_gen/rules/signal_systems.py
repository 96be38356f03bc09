"""Signalled junctions so near each other that one controller has to run them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from foretwin.world_gen.lanes.cluster import Cluster
from foretwin.world_gen.lanes.clusters import Surroundings
from foretwin.world_gen.roads.road_graph import DirectedEdge, EdgeKey
from foretwin.world_gen.rules.signal_groups import LaneGroup

NEAR_M = 60.0
"""A queue of ten cars before one light stands in the other junction."""


class SignalSystems(NamedTuple):
    """Which junctions run together, each by the ids of its members, and which groups `follow`.

    Who is let go by the first group of a pair comes to the second one next.
    """

    members: Sequence[Sequence[str]]
    follow: frozenset[tuple[str, str]]


def signal_systems(
    groups: Mapping[str, Sequence[LaneGroup]], around: Surroundings
) -> SignalSystems:
    """Return the signalled junctions of a World by the systems that they form, most of them alone.

    `groups` are those of each junction. Junctions are one system where a road of `NEAR_M` at most
    leads from one to the other.
    """
    cluster_at = {node: cluster for cluster in around.clusters for node in cluster.nodes}
    let_go: dict[EdgeKey, list[tuple[str, LaneGroup]]] = {}
    for name, mine in groups.items():
        for group in mine:
            for away in {c.movement.away.key for c in group.connections}:
                let_go.setdefault(away, []).append((name, group))
    leader = {name: name for name in groups}
    follow: set[tuple[str, str]] = set()
    for name, mine in groups.items():
        for group in mine:
            for road in _back_along(group.approach.toward, cluster_at):
                for other, before in let_go.get(road.key, ()):
                    if other != name:
                        follow.add((before.id, group.id))
                        first, second = sorted((_first_of(name, leader), _first_of(other, leader)))
                        leader[second] = first
    members: dict[str, list[str]] = {}
    for name in sorted(groups):
        members.setdefault(_first_of(name, leader), []).append(name)
    return SignalSystems(tuple(members.values()), frozenset(follow))


def _first_of(name: str, leader: Mapping[str, str]) -> str:
    while leader[name] != name:
        name = leader[name]
    return name


def _back_along(toward: DirectedEdge, cluster_at: Mapping[int, Cluster]) -> Iterator[DirectedEdge]:
    """Yield the roads by which cars come to a junction, as they drive, the last one first."""
    gone_m = 0.0
    while gone_m <= NEAR_M and toward.allowed:
        gone_m += toward.edge.length_m
        if gone_m <= NEAR_M:
            yield toward
        before = cluster_at.get(toward.start_node)
        if before is None or not before.plain:
            return
        onward = [leg for leg in before.legs if leg.edge.index != toward.edge.index]
        if not onward:
            return
        toward = onward[0].back
