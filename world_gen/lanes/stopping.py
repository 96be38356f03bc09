"""Where the map has cars stop before a place: lanes must reach so far."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

from foretwin.geometry.polyline import arc_lengths
from foretwin.world_gen.lanes.cluster import Cluster
from foretwin.world_gen.lanes.lane_plans import CrossSection
from foretwin.world_gen.roads.road_graph import DirectedEdge
from foretwin.world_gen.roads.road_tags import is_crossed

NodeTags = Mapping[int, Mapping[str, str]]
OWN_LINE_M = 3.0
"""A sign or signal farther than this from the junction's node stands at the stop line."""
CROSSING_WIDTH_M = 4.0
BEFORE_CROSSING_M = CROSSING_WIDTH_M / 2.0 + 1.0
"""From a crossing's middle to the line before it: half its width and a metre (RMS 2; MUTCD 3B.16
has 4 ft)."""
CAR_ROOM_M = 4.74
"""Room behind a car that waits past a crossing: the length of RASt 06's car. With less it would
block the crossing, and waits before it."""
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
        on_foot = is_crossed(tags)
        if kind == "traffic_signals" and at_m > OWN_LINE_M:
            lights.append(at_m + (BEFORE_CROSSING_M if on_foot else 0.0))
        elif on_foot and lit and 1.0 < at_m <= CROSSING_NEAR_M:
            crossings.append(at_m + BEFORE_CROSSING_M)
        elif kind in ("stop", "give_way") and at_m > OWN_LINE_M:
            signs.append(at_m)
    line_m: float = min(max(lights or crossings, default=math.inf), *signs, math.inf)
    return line_m - LINE_SETBACK_M


def must_reach_m(
    leg: DirectedEdge,
    cluster: Cluster,
    sections: Mapping[int, CrossSection],
    node_tags: NodeTags,
) -> float:
    """Return how far along a leg lanes must reach; nowhere where all of them lead outward."""
    driven_in = sections[leg.edge.index].along(reverse=not leg.reverse).abreast
    return stop_line_m(leg, cluster, node_tags) if driven_in else math.inf


def before_crossings_m(leg: DirectedEdge, node_tags: NodeTags) -> float:
    """Return how far along a leg the first crossing on foot begins: its line spans lanes."""
    if not any(node in node_tags for node in leg.node_ids[1:]):
        return math.inf
    at_m = arc_lengths(leg.xy_m).tolist()
    tagged = ((node_tags.get(node, {}), m) for node, m in zip(leg.node_ids, at_m, strict=False))
    crossings = (m for tags, m in tagged if is_crossed(tags))
    return max(min(crossings, default=math.inf) - BEFORE_CROSSING_M, 0.0)


def clear_of_crossings(
    line_m: float,
    crossings_m: Iterable[float],
    *,
    served_m: float = 0.0,
    most_m: float = math.inf,
) -> float:
    """Return where cars stop who would stop at `line_m`: before each crossing that they would else
    stand on, or past with less room behind them than a car needs, and before those up to
    `served_m`, for which the line's light stands too.

    All are metres on the way back from a junction, to the middles of crossings. No line lies
    farther back than `most_m`, where the lane begins: it is then where it was.
    """
    for at_m in sorted(crossings_m):
        before_m = at_m + BEFORE_CROSSING_M
        blocked = at_m - CROSSING_WIDTH_M / 2.0 - line_m < CAR_ROOM_M
        if line_m < before_m <= most_m and (blocked or at_m <= served_m):
            line_m = before_m
    return line_m


def faces(tags: Mapping[str, str], against_outward: bool) -> bool | None:
    """Return whether a sign or light is for those who drive along (true) the way's nodes.

    `against_outward` is whether traffic in question runs along the nodes. None: it is not tagged.
    """
    for key in ("traffic_signals:direction", "stop:direction", "give_way:direction", "direction"):
        word = tags.get(key)
        if word in ("forward", "backward"):
            return (word == "forward") == against_outward
    return None
