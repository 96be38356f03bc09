"""What a driver meets on the way to a junction and through it: lights, signs and crossings."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple

from foretwin.contracts.world import YieldRule
from foretwin.geometry.polyline import arc_lengths
from foretwin.geometry.polyline_batch import Polylines
from foretwin.world_gen.lanes.cluster import Cluster
from foretwin.world_gen.lanes.legs import is_ring_edge
from foretwin.world_gen.lanes.stopping import NodeTags, faces
from foretwin.world_gen.roads.road_graph import DirectedEdge, RoadEdge

LOOK_BACK_M = 40.0


class Met(NamedTuple):
    """A tagged node on an approach, `distance_m` before the junction's node; infinite inside."""

    node: int
    distance_m: float
    tags: Mapping[str, str]


def is_light(tags: Mapping[str, str]) -> bool:
    """Return whether a node is a light for cars."""
    return tags.get("highway") == "traffic_signals"


def sign_of(tags: Mapping[str, str]) -> YieldRule | None:
    """Return the sign that a node carries; German signs count by their number too."""
    word = tags.get("highway")
    sign = tags.get("traffic_sign", "")
    if word == "stop" or sign.startswith("DE:206"):
        return "stop"
    return "give_way" if word == "give_way" or sign.startswith("DE:205") else None


class Passed(NamedTuple):
    """An edge's length, and its tagged nodes in the order of the way, each with its arc length."""

    length_m: float
    tagged: tuple[tuple[int, float], ...]


def passed_on(edges: Mapping[int, RoadEdge], node_tags: NodeTags) -> dict[int, Passed]:
    """Return what lies on every edge, by edge index."""
    paths = Polylines.of([edge.xy_m for edge in edges.values()])
    found = {}
    rows = zip(edges.items(), paths.first[:-1].tolist(), paths.length_m.tolist(), strict=True)
    for (index, edge), first, length_m in rows:
        nodes = enumerate(edge.node_ids, first)
        tagged = tuple((node, float(paths.arc_m[i])) for i, node in nodes if node in node_tags)
        found[index] = Passed(length_m, tagged)
    return found


def met_toward(
    leg: DirectedEdge,
    plain_from: Mapping[int, Cluster],
    node_tags: NodeTags,
    junction_nodes: Collection[int],
    passed: Mapping[int, Passed],
) -> list[Met]:
    """Walk outward along the leg, on through nodes where the road merely goes on.

    A node without a tagged direction counts for the nearer junction, on a ring, which is driven
    one way round, for the road that enters next. `passed` is that of `passed_on`.
    """
    found: list[tuple[Met, bool]] = []
    gone, current, meets_another = 0.0, leg, False
    for _ in range(8):
        length_m, tagged = passed[current.edge.index]
        for node, arc_m in tagged[::-1] if current.reverse else tagged:
            at_m = gone + (length_m - arc_m if current.reverse else arc_m)
            facing = faces(node_tags[node], current.reverse)
            if facing is not False and at_m <= LOOK_BACK_M:
                unsaid = facing is None and not is_ring_edge(current.edge)
                found.append((Met(node, at_m, node_tags[node]), unsaid))
        gone += length_m
        cluster = plain_from.get(current.end_node)
        meets_another = cluster is None
        if cluster is None or cluster.whole or current.end_node in junction_nodes:
            break
        if gone > 2.0 * LOOK_BACK_M:
            break
        onward = [d for d in cluster.legs if d.edge.index != current.edge.index]
        if not onward:
            break
        current = onward[0]
    nearer_m = gone / 2.0 if meets_another else math.inf
    unique = {m.node: m for m, unsaid in found if not unsaid or m.distance_m <= nearer_m}
    return list(unique.values())


def own_sign(
    met: Sequence[Met], toward: DirectedEdge, cluster: Cluster, edges: Mapping[int, RoadEdge]
) -> Met | None:
    """Return the nearest sign on a road; one on a node that others come to as well is no clue."""
    signs = (m for m in met if sign_of(m.tags) and m.distance_m <= LOOK_BACK_M)
    for sign in sorted(signs, key=lambda m: m.distance_m):
        if sign.distance_m > 0.1 or cluster.ring or _comes_alone(toward, cluster, edges):
            return sign
    return None


def _comes_alone(toward: DirectedEdge, cluster: Cluster, edges: Mapping[int, RoadEdge]) -> bool:
    """Return whether no other road of a cluster may be driven to the node where this one ends."""
    node = toward.end_node
    inner = (edges[i] for i in cluster.inner if i in edges)
    return not any(
        (edge.forward and edge.end_node == node) or (edge.backward and edge.start_node == node)
        for edge in (*inner, *(leg.edge for leg in cluster.legs))
        if edge.index != toward.edge.index
    )


def lights_inside(inside: Sequence[DirectedEdge], node_tags: NodeTags) -> list[Met]:
    """Return the lights met between a junction's nodes, in driving order."""
    found = []
    for part in inside:
        for node in part.node_ids:
            tags = node_tags.get(node)
            # Who drives along the nodes meets what faces forward.
            if tags and is_light(tags) and faces(tags, not part.reverse) is not False:
                found.append(Met(node, math.inf, tags))
    return found


def lights_behind(leg: DirectedEdge, node_tags: NodeTags, within_m: float) -> list[int]:
    """Return the lights on a road out of a junction, no farther than `within_m` from it."""
    places = zip(leg.node_ids, arc_lengths(leg.xy_m), strict=False)
    near = [node for node, at_m in places if 0.1 < at_m <= within_m]
    return [node for node in near if is_light(node_tags.get(node, {}))]
