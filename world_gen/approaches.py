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
_SIGNAL_NEAR_M = 25.0
_OWN_LINE_M = 3.0
"""A sign or signal farther than this from the junction's node stands at the stop line."""
_SIGNS = ("stop", "give_way")
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
    """One leg driven toward a junction, and how it is controlled there.

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
    """Return every approach to a whole junction with its control."""
    plain_from = {
        leg.start_node: cluster
        for cluster in around.clusters
        if cluster.plain
        for leg in cluster.legs
    }
    found = []
    top = _top_ranks(around)
    for cluster in around.clusters:
        junction = cluster.junction
        if not cluster.whole or junction is None:
            continue
        for leg in cluster.legs:
            toward = DirectedEdge(leg.edge, not leg.reverse)
            inside = leg.edge.index in junction.inner
            if not toward.allowed or (inside and (is_ring_edge(leg.edge) or not cluster.ring)):
                continue
            met = _met(leg, plain_from, node_tags, junction)
            found.append(_approach(cluster, toward, met, junction, top[junction.summary.id]))
    return tuple(found)


def _top_ranks(around: Surroundings) -> dict[str, int]:
    """Return the highest rank among the roads of each whole junction, by its id."""
    top: dict[str, int] = {}
    for cluster in around.clusters:
        if cluster.whole and cluster.junction is not None:
            name = cluster.junction.summary.id
            ranks = [class_rank(leg.edge.road_class) for leg in cluster.legs]
            top[name] = max([top.get(name, 0), *ranks])
    return top


def class_rank(road_class: str) -> int:
    """Return how important a highway class is; links count as their class."""
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
            or cluster.whole
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
    signals = [m for m in met if m.tags.get("highway") == "traffic_signals"]
    signalled = junction.summary.control == "signals"
    if not signalled:
        # A light farther away is one for pedestrians, not for this junction.
        signals = [m for m in signals if m.distance_m <= _SIGNAL_NEAR_M]
    if signalled or signals:
        signal = max(signals, key=lambda m: m.distance_m, default=None)
        line = _before_crossing(met)
        source: Provenance = "inferred"
        node: int | None = None
        if signal is not None:
            source, node = "tagged", signal.node
            line = signal.distance_m if signal.distance_m > _OWN_LINE_M else line
        return Approach(cluster, toward, Choice("signal", source), line, node)
    sign = min(
        (m for m in met if m.tags.get("highway") in _SIGNS and _is_for(m, cluster, junction)),
        key=lambda m: m.distance_m,
        default=None,
    )
    if sign is None:
        word, guessed = _unsigned(cluster, toward, junction, top_rank)
        return Approach(cluster, toward, Choice(word, guessed), None, None)
    line = sign.distance_m if _OWN_LINE_M < sign.distance_m <= _SIGNAL_NEAR_M else None
    return Approach(cluster, toward, Choice(sign.tags["highway"], "tagged"), line, None)


def _is_for(sign: Met, cluster: Cluster, junction: Junction) -> bool:
    """Return whether a sign is for this approach; on the junction's own node it cannot tell."""
    at_node = sign.distance_m < 0.1 and len(cluster.legs) > 2
    return not at_node or junction.summary.control == "all_way_stop"


def _before_crossing(met: list[Met]) -> float | None:
    """Return where cars wait for a light before the crossing that they would else block."""
    at = [
        m.distance_m
        for m in met
        if (m.tags.get("highway") == "crossing" or "crossing" in m.tags)
        and 1.0 < m.distance_m <= _CROSSING_NEAR_M
    ]
    return max(at) + 3.0 if at else None


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
