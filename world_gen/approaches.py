"""What a driver meets on the way to the junction: signals, signs and crossings on an approach."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from contracts.world import Choice, LineControl, Provenance
from world_gen.clusters import Cluster, Surroundings, is_ring_edge
from world_gen.intersections import Junction
from world_gen.polyline import arc_lengths
from world_gen.road_graph import DirectedEdge

LOOK_BACK_M = 40.0
_CROSSING_NEAR_M = 16.0
_CONTROL: Mapping[str, LineControl] = {
    "traffic_signals": "signal",
    "stop": "stop",
    "give_way": "give_way",
}
_CLASS_RANK: Mapping[str, int] = {
    "motorway": 8,
    "trunk": 7,
    "primary": 6,
    "secondary": 5,
    "tertiary": 4,
    "unclassified": 3,
    "residential": 3,
    "living_street": 1,
}


class Met(NamedTuple):
    """A tagged node on an approach, `distance_m` before the junction's node."""

    node: int
    distance_m: float
    tags: Mapping[str, str]


class Approach(NamedTuple):
    """One leg driven toward the main junction, and how it is controlled there.

    `line_m` is where vehicles stop, metres along the leg from its node; None: where lanes end.
    `signal_node` is the OSM node of the signal that governs it, where the map has one.
    """

    cluster: Cluster
    toward: DirectedEdge
    control: Choice
    line_m: float | None
    signal_node: int | None


def approaches(
    around: Surroundings, node_tags: Mapping[int, Mapping[str, str]]
) -> tuple[Approach, ...]:
    """Return every approach to the main junction with its control."""
    plain_from = {
        leg.start_node: cluster
        for cluster in around.clusters
        if cluster.plain
        for leg in cluster.legs
    }
    found = []
    top = _top_rank(around)
    for cluster in around.clusters:
        if not cluster.main:
            continue
        for leg in cluster.legs:
            toward = DirectedEdge(leg.edge, not leg.reverse)
            inside = leg.edge.index in around.junction.inner
            if not toward.allowed or (inside and (is_ring_edge(leg.edge) or not cluster.ring)):
                continue
            met = _met(leg, plain_from, node_tags, around.junction)
            found.append(_approach(cluster, toward, met, around.junction, top))
    return tuple(found)


def _top_rank(around: Surroundings) -> int:
    legs = [leg for c in around.clusters if c.main for leg in c.legs]
    return max((class_rank(leg.edge.road_class) for leg in legs), default=0)


def class_rank(road_class: str) -> int:
    """Return how important a highway class is; links count as their class less a half step."""
    return _CLASS_RANK.get(road_class.removesuffix("_link"), 2)


def _met(
    leg: DirectedEdge,
    plain_from: Mapping[int, Cluster],
    node_tags: Mapping[int, Mapping[str, str]],
    junction: Junction,
) -> list[Met]:
    """Walk outward along the leg, on through nodes where the road merely goes on."""
    found: list[Met] = []
    gone, current = 0.0, leg
    for _ in range(8):
        nodes = current.edge.node_ids[::-1] if current.reverse else current.edge.node_ids
        along = arc_lengths(current.xy_m)
        for node, at in zip(nodes, along, strict=False):
            tags = node_tags.get(node)
            if tags and gone + at <= LOOK_BACK_M and _faces(tags, current):
                found.append(Met(node, gone + float(at), tags))
        gone += float(along[-1])
        cluster = plain_from.get(current.end_node)
        if (
            gone > LOOK_BACK_M
            or cluster is None
            or cluster.main
            or current.end_node in junction.nodes
        ):
            break
        onward = [d for d in cluster.legs if d.edge.index != current.edge.index]
        if not onward:
            break
        current = onward[0]
    return found


def _faces(tags: Mapping[str, str], outward: DirectedEdge) -> bool:
    """Return whether a sign or signal is meant for traffic toward the junction."""
    word = tags.get("traffic_signals:direction") or tags.get("direction")
    if word not in ("forward", "backward"):
        return True
    # Traffic toward the junction runs along the nodes exactly where the outward edge is reversed.
    return (word == "forward") == outward.reverse


def _approach(
    cluster: Cluster, toward: DirectedEdge, met: list[Met], junction: Junction, top_rank: int
) -> Approach:
    crossing_m = max(
        (
            m.distance_m
            for m in met
            if m.tags.get("highway") == "crossing" or "crossing" in m.tags
            if 1.0 < m.distance_m <= _CROSSING_NEAR_M
        ),
        default=None,
    )
    before_crossing = None if crossing_m is None else crossing_m + 3.0
    signed = [m for m in met if m.tags.get("highway") in _CONTROL]
    if junction.summary.control == "signals":
        signals = [m for m in signed if m.tags["highway"] == "traffic_signals"]
        signal = max(signals, key=lambda m: m.distance_m, default=None)
        if signal is None:
            return Approach(cluster, toward, Choice("signal", "inferred"), before_crossing, None)
        line = signal.distance_m if signal.distance_m > 3.0 else before_crossing
        return Approach(cluster, toward, Choice("signal", "tagged"), line, signal.node)
    if signed:
        first = min(signed, key=lambda m: m.distance_m)
        line = first.distance_m if first.distance_m > 3.0 else before_crossing
        word = _CONTROL[first.tags["highway"]]
        # A sign on the junction's own node cannot tell which approach it is for.
        at_node = first.distance_m < 0.1 and len(cluster.legs) > 2
        if not (
            at_node and word in ("stop", "give_way") and junction.summary.control != "all_way_stop"
        ):
            node = first.node if word == "signal" else None
            return Approach(cluster, toward, Choice(word, "tagged"), line, node)
    word, source = _unsigned(cluster, toward, junction, top_rank)
    return Approach(cluster, toward, Choice(word, source), before_crossing, None)


def _unsigned(
    cluster: Cluster, toward: DirectedEdge, junction: Junction, top_rank: int
) -> tuple[LineControl, Provenance]:
    control = junction.summary.control
    if cluster.ring or control == "roundabout":
        return "give_way", "inferred"
    if control == "all_way_stop":
        return "stop", "inferred"
    lesser = class_rank(toward.edge.road_class) < top_rank and top_rank >= 4
    if control in ("stop", "give_way"):
        return ("give_way", "inferred") if lesser else ("none", "inferred")
    return ("give_way", "inferred") if lesser else ("none", "default")
