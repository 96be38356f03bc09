"""Where the map has cars stop before a place: lanes must reach so far."""

from __future__ import annotations

import math
from collections.abc import Mapping

from foretwin.geometry.polyline import arc_lengths
from foretwin.world_gen.lanes.cluster import Cluster
from foretwin.world_gen.roads.road_graph import DirectedEdge

NodeTags = Mapping[int, Mapping[str, str]]
OWN_LINE_M = 3.0
"""A sign or signal farther than this from the junction's node stands at the stop line."""
BEFORE_CROSSING_M = 3.0
"""From a crossing's middle to the line before it: half its width and a metre (RMS 2)."""
LINE_SETBACK_M = 0.3
"""From a stop line to where its lane ends."""
CROSSING_NEAR_M = 16.0
"""Crossings farther from a junction are not its own."""
_LINE_NEAR_M = 25.0


def stop_line_m(leg: DirectedEdge, cluster: Cluster, node_tags: NodeTags) -> float:
    """Return how far along a leg the map has cars stop that drive in: lanes must reach so far.

    That is at a light, or before a crossing where there are lights, else at a sign.
    """
    if not any(node in node_tags for node in leg.node_ids[1:]):
        return math.inf
    lit = cluster.junction is not None and cluster.junction.summary.control == "signals"
    lights, crossings, signs = [], [], []
    for node, at_m in zip(leg.node_ids, arc_lengths(leg.xy_m).tolist(), strict=False):
        tags = node_tags.get(node, {})
        kind = tags.get("highway")
        if at_m > _LINE_NEAR_M or faces(tags, leg.reverse) is False:
            continue
        on_foot = kind == "crossing" or "crossing" in tags
        if kind == "traffic_signals" and at_m > OWN_LINE_M:
            lights.append(at_m + (BEFORE_CROSSING_M if on_foot else 0.0))
        elif on_foot and lit and 1.0 < at_m <= CROSSING_NEAR_M:
            crossings.append(at_m + BEFORE_CROSSING_M)
        elif kind in ("stop", "give_way") and at_m > OWN_LINE_M:
            signs.append(at_m)
    line_m: float = min(max(lights or crossings, default=math.inf), *signs, math.inf)
    return line_m - LINE_SETBACK_M


def before_crossings_m(leg: DirectedEdge, node_tags: NodeTags) -> float:
    """Return how far along a leg the first crossing on foot begins: its line spans lanes."""
    if not any(node in node_tags for node in leg.node_ids[1:]):
        return math.inf
    at_m = arc_lengths(leg.xy_m).tolist()
    tagged = ((node_tags.get(node, {}), m) for node, m in zip(leg.node_ids, at_m, strict=False))
    crossings = (m for tags, m in tagged if tags.get("highway") == "crossing" or "crossing" in tags)
    return max(min(crossings, default=math.inf) - BEFORE_CROSSING_M, 0.0)


def faces(tags: Mapping[str, str], against_outward: bool) -> bool | None:
    """Return whether a sign or light is for those who drive along (true) the way's nodes.

    `against_outward` is whether traffic in question runs along the nodes. None: it is not tagged.
    """
    for key in ("traffic_signals:direction", "stop:direction", "give_way:direction", "direction"):
        word = tags.get(key)
        if word in ("forward", "backward"):
            return (word == "forward") == against_outward
    return None
