"""Signs between a junction's nodes: on slip roads, in medians, where a mouth is split."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from operator import attrgetter
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.world import DrivingSide, YieldRule
from foretwin.geometry.polyline import arc_lengths, locate, points_at
from foretwin.world_gen.connections.lane_connections import ConnectionDraft
from foretwin.world_gen.lanes.cluster import Cluster
from foretwin.world_gen.lanes.clusters import Surroundings
from foretwin.world_gen.lanes.stopping import NodeTags, faces
from foretwin.world_gen.roads.road_graph import DirectedEdge, EdgeKey
from foretwin.world_gen.rules.control_devices import sign_of

_BESIDE_M = 1.0


class SignInside(NamedTuple):
    """A sign that a connection passes, `at_m` along its path.

    `on_path` means that the path keeps to the sign's road there, and cuts no corner.
    """

    node: int
    rule: YieldRule
    at_m: float
    on_path: bool


SignsInside = Mapping[str, Sequence[SignInside]]
"""Signs in the order in which they are met, by the id of the connection that passes them."""


def signs_inside(
    connections: Sequence[ConnectionDraft], node_tags: NodeTags, around: Surroundings
) -> SignsInside:
    """Return the signs that each connection passes on its way through a whole junction."""
    found: dict[str, tuple[SignInside, ...]] = {}
    ends: dict[str, Counter[int]] = {}
    for c in connections:
        inside = c.movement.inside
        if not c.cluster.whole or not any(_is_signed(part, node_tags) for part in inside):
            continue
        if c.cluster.key not in ends:
            ends[c.cluster.key] = _road_ends(c.cluster, around)
        met: dict[int, SignInside] = {}
        for node, part, xy_m in _met(inside, node_tags, ends[c.cluster.key]):
            rule = sign_of(node_tags[node])
            if rule is not None and node not in met:
                at_m = locate(c.centerline, xy_m)
                off_m = float(np.hypot(*(points_at(c.centerline, at_m) - xy_m)))
                section = around.section(part)
                reach_m = max(section.left_m, -section.right_m) + _BESIDE_M
                met[node] = SignInside(node, rule, at_m, off_m <= reach_m)
        if met:
            found[c.id] = tuple(met.values())
    return found


def shared_signs(
    connections: Sequence[ConnectionDraft], signs: SignsInside, driving_side: DrivingSide
) -> dict[EdgeKey, YieldRule]:
    """Return the sign that all ways from a road pass, by its (edge index, reverse).

    Such a sign is the road's own. One of the ways turns to the near side: in a median, which
    those who so turn do not reach, a sign is for what lies behind it.
    """
    passed: dict[EdgeKey, dict[int, SignInside]] = {}
    near: set[EdgeKey] = set()
    for c in connections:
        if not c.cluster.whole or c.turn == "u_turn":
            continue
        road = c.movement.toward.key
        mine = {sign.node: sign for sign in signs.get(c.id, ())}
        known = passed.get(road)
        passed[road] = mine if known is None else {n: s for n, s in known.items() if n in mine}
        if c.turn == driving_side:
            near.add(road)
    first = attrgetter("at_m")
    shared = {road: mine for road, mine in passed.items() if road in near and mine}
    return {road: min(mine.values(), key=first).rule for road, mine in shared.items()}


def _is_signed(part: DirectedEdge, node_tags: NodeTags) -> bool:
    return any(node in node_tags and sign_of(node_tags[node]) for node in part.edge.node_ids)


def _road_ends(cluster: Cluster, around: Surroundings) -> Counter[int]:
    """Return how many roads end at each of a cluster's nodes."""
    ends = Counter(leg.start_node for leg in cluster.legs)
    for index in cluster.inner:
        edge = around.edges.get(index)
        if edge is not None:
            ends.update((edge.start_node, edge.end_node))
    return ends


def _met(
    inside: Sequence[DirectedEdge], node_tags: NodeTags, ends: Mapping[int, int]
) -> Iterator[tuple[int, DirectedEdge, Array]]:
    """Yield the signs that face who drives along `inside`: node, road and place (2,).

    One without a tagged direction counts on a one-way road, and on another for those who
    come to the nearer of the two nodes at which roads meet; on such a node it does not count.
    """
    for run in _runs(inside, ends):
        total_m = sum(part.edge.length_m for part in run)
        first, last = run[0].start_node, run[-1].end_node
        gone_m = 0.0
        for part in run:
            along_m = arc_lengths(part.xy_m)
            rows = zip(part.node_ids, part.xy_m, (gone_m + along_m).tolist(), strict=True)
            for node, place_m, at_m in rows:
                if node not in node_tags or not sign_of(node_tags[node]):
                    continue
                facing = faces(node_tags[node], not part.reverse)
                if facing is None and node not in (first, last):
                    facing = part.edge.one_way or at_m >= total_m / 2.0
                if facing:
                    yield node, part, place_m
            gone_m += float(along_m[-1])


def _runs(inside: Sequence[DirectedEdge], ends: Mapping[int, int]) -> list[list[DirectedEdge]]:
    """Return the roads inside, in pieces from one node at which roads meet to the next."""
    runs: list[list[DirectedEdge]] = []
    for part in inside:
        if runs and ends[part.start_node] == 2:
            runs[-1].append(part)
        else:
            runs.append([part])
    return runs
