"""How a junction is controlled: lights, signs, or the general rules."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple

import numpy as np

from foretwin.contracts.world import Control
from foretwin.geometry.polyline import arc_lengths
from foretwin.world_gen.junctions.chains import Chain, Mark, Tags
from foretwin.world_gen.roads.road_graph import DirectedEdge, RoadEdge
from foretwin.world_gen.roads.road_tags import is_crossed

_SIGNS = ("stop", "give_way")
SIGNALS_WITHIN_M, SIGNS_WITHIN_M = 40.0, 30.0
PEDESTRIAN_LIGHT_M = 15.0
"""A light at a crossing farther out than this serves pedestrians alone."""
OWN_LIGHT_M = 25.0
"""Beside a road whose sign rules, a light farther out than this may be that of a crossing too."""


class JunctionControl(NamedTuple):
    """How a junction is controlled, and the nodes of its traffic lights."""

    control: Control
    lights: frozenset[int]


def control_of(
    core: frozenset[int],
    inside: tuple[Chain, ...],
    incoming: tuple[Chain, ...],
    node_tags: Mapping[int, Tags],
    *,
    ring: bool,
    ring_edges: Iterable[RoadEdge] = (),
    all_way_stops: bool = False,
    leaving: Mapping[int, tuple[DirectedEdge, ...]] | None = None,
) -> JunctionControl:
    """Return how the junction is controlled, from the tags in it and on its roads in.

    `ring_edges` are those of the ring that it is made of, if it is one; `leaving` the edges that
    start at each node of the road graph.

    A light or sign counts for the nearer junction of the road it stands on, or the one that it
    faces; signs on every road in make an all-way stop, in countries of `all_way_stops` one on
    the junction's own node, too, unless it says which roads it stops. Lights on a crossing of one
    road in alone, or inside where roads in have stop signs, stop cars for those on foot, and leave
    the junction to signs and rules; so do lights before a crossing or a side road behind which a
    sign follows, where no road has another light.
    """
    inner = [node_tags[node] for node in core if node in node_tags]
    inner += [mark.tags for chain in inside for mark in chain.marks]
    between = [mark for chain in inside for mark in chain.marks if mark.node not in core]
    stopped = any(_sign(chain, "stop") for chain in incoming)
    found = {node for node in core if node in node_tags and _is_light(node_tags[node], 0.0)}
    found.update(
        mark.node
        for mark in between
        if _is_light(mark.tags, 0.0) and not (stopped and _for_walkers(mark.tags))
    )
    found.update(
        mark.node
        for mark in _marks_on(ring_edges, node_tags)
        if _is_light(mark.tags, mark.distance_m)
    )
    faced = [list(facing(chain, SIGNALS_WITHIN_M, "traffic_signals")) for chain in incoming]
    if not found and _signs_follow(incoming, faced, node_tags, leaving or {}):
        faced = []
    lights = [mark for marks in faced for mark in marks if _is_light(mark.tags, mark.distance_m)]
    for_cars = any(not _for_walkers(mark.tags) for mark in lights)
    if found or for_cars or len(incoming) == 1 or sum(map(bool, faced)) > 1:
        found.update(mark.node for mark in lights)
    if found:
        return JunctionControl("signals", frozenset(found))
    return JunctionControl(
        "roundabout" if ring else _signs(inner, incoming, all_way_stops), frozenset()
    )


def _signs_follow(
    incoming: tuple[Chain, ...],
    faced: list[list[Mark]],
    node_tags: Mapping[int, Tags],
    leaving: Mapping[int, tuple[DirectedEdge, ...]],
) -> bool:
    """Return whether a sign rules where drivers have come past all lights.

    On one road at least a crossing or a side road lies between the nearest light and a sign; on
    others without one the light stands far out, with such a place behind it.
    """
    signed = False
    for chain, marks in zip(incoming, faced, strict=True):
        lights_m = [mark.distance_m for mark in marks if _is_light(mark.tags, mark.distance_m)]
        if not lights_m:
            continue
        places_m = _places_m(chain, node_tags, leaving)
        between_m = [at_m for at_m in places_m if PEDESTRIAN_LIGHT_M < at_m < lights_m[0]]
        signs = [m for word in _SIGNS for m in facing(chain, SIGNS_WITHIN_M, word)]
        sign_m = min([mark.distance_m for mark in signs], default=math.inf)
        if any(sign_m < at_m for at_m in between_m):
            signed = True
        elif not between_m or lights_m[0] <= OWN_LIGHT_M:
            return False
    return signed


def _places_m(
    chain: Chain, node_tags: Mapping[int, Tags], leaving: Mapping[int, tuple[DirectedEdge, ...]]
) -> list[float]:
    """Return how far along a chain people cross it on foot, or side roads of any kind meet it."""
    ids = [node for item in chain.edges for node in item.node_ids]
    along_m = arc_lengths(np.column_stack([chain.x_m, chain.y_m])).tolist()
    return [
        at_m
        for node, at_m in zip(ids, along_m, strict=True)
        if is_crossed(node_tags.get(node, {})) or len(leaving.get(node, ())) > 2
    ]


def _marks_on(edges: Iterable[RoadEdge], node_tags: Mapping[int, Tags]) -> Iterator[Mark]:
    """Yield the tagged nodes on a ring's edges, each so far before the edge's end."""
    for edge in edges:
        if node_tags.keys().isdisjoint(edge.node_ids):
            continue
        way = DirectedEdge(edge, reverse=not edge.forward)
        along_m = arc_lengths(way.xy_m)
        for node, at_m in zip(way.node_ids, along_m.tolist(), strict=True):
            if node in node_tags:
                yield Mark(node, node_tags[node], float(along_m[-1]) - at_m)


def _signs(inner: list[Tags], incoming: tuple[Chain, ...], all_way_stops: bool) -> Control:
    """Return the control by signs among `inner` tags and on the roads in."""
    stops = [tags for chain in incoming if (tags := _sign(chain, "stop")) is not None]
    inner_stops = [tags for tags in inner if tags.get("highway") == "stop"]
    all_way = any(tags.get("stop") == "all" for tags in (*inner_stops, *stops))
    unsaid = all_way_stops and not stops and any("stop" not in tags for tags in inner_stops)
    if all_way or unsaid or len(stops) == len(incoming) >= 3:
        return "all_way_stop"
    if inner_stops or stops:
        return "stop"
    signed = any(_sign(chain, "give_way") is not None for chain in incoming)
    if signed or any(tags.get("highway") == "give_way" for tags in inner):
        return "give_way"
    return "uncontrolled"


def _sign(chain: Chain, word: str) -> Tags | None:
    return next((mark.tags for mark in facing(chain, SIGNS_WITHIN_M, word)), None)


def _is_light(tags: Tags, distance_m: float) -> bool:
    if tags.get("highway") != "traffic_signals":
        return False
    return distance_m <= PEDESTRIAN_LIGHT_M or not _for_walkers(tags)


def _for_walkers(tags: Tags) -> bool:
    return is_crossed(tags) or tags.get("traffic_signals") == "pedestrian_crossing"


def facing(chain: Chain, within_m: float, word: str) -> Iterator[Mark]:
    """Yield the nodes of `highway=word` that drivers towards a junction obey, nearest first.

    `chain` leaves the junction. A node counts up to `within_m` where it is tagged to face who
    comes in, or stands on a one-way road and at no crossing; else on the nearer half alone.
    """
    nearer_m = min(within_m, chain.length_m / 2.0)
    for mark in chain.marks:
        node, tags, distance_m = mark
        if distance_m > within_m:
            break
        if tags["highway"] != word or node in (chain.start, chain.end):
            continue
        faced = tags.get(f"{word}:direction") or tags.get("direction")
        along = next((item for item in chain.edges if node in item.edge.node_ids[1:-1]), None)
        if along is not None and faced in ("forward", "backward"):
            # The chain leaves the junction: who comes in drives against it.
            if faced == ("forward" if along.reverse else "backward"):
                yield mark
        elif distance_m <= nearer_m or (chain.one_way and not is_crossed(tags)):
            yield mark
