"""Intersections of a CommonRoad scenario: which lanes come in where, and which ways lead on."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Mapping

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.world import Connection, Lane, World
from foretwin.geometry.polyline import unit
from foretwin.world_gen.export.lanelets import indicated
from foretwin.world_gen.export.xml_tree import Element, child, element

LEFT_OF_RAD = math.radians(150.0)
"""Traffic from farther round does not come from the left but from ahead."""
_TAGS = {"right": "successorsRight", "straight": "successorsStraight", "left": "successorsLeft"}
_Approach = tuple[str, bool]


def intersections(world: World, lanes: Mapping[str, int], ids: Iterator[int]) -> Iterator[Element]:
    """Yield an intersection for each place where lanes of a junction meet.

    A junction is one such place, a roundabout one for each node of its ring. Lanes of one road
    and direction come in together.
    """
    by_id = {lane.id: lane for lane in world.lanes}
    places: dict[str, dict[_Approach, list[Connection]]] = defaultdict(lambda: defaultdict(list))
    for c in world.connections:
        if c.junction_id and c.id in lanes:
            start = by_id[c.from_lane_id]
            approach = (start.road_id or start.id, start.reverse)
            places[c.place_id or c.junction_id][approach].append(c)
    side = world.intersection.driving_side
    for incoming in places.values():
        made = element("intersection", id=next(ids))
        numbers = {approach: next(ids) for approach in incoming}
        left_of = _left_of(incoming, by_id)
        for approach, connections in incoming.items():
            part = child(made, "incoming", id=numbers[approach])
            for lane_id in dict.fromkeys(c.from_lane_id for c in connections):
                child(part, "incomingLanelet", ref=lanes[lane_id])
            for turn, tag in _TAGS.items():
                for c in connections:
                    if indicated(c.turn, side) == turn:
                        child(part, tag, ref=lanes[c.id])
            if approach in left_of:
                child(part, "isLeftOf", ref=numbers[left_of[approach]])
        yield made


def _left_of(
    incoming: Mapping[_Approach, list[Connection]], lanes: Mapping[str, Lane]
) -> dict[_Approach, _Approach]:
    """Return for each approach the one from whose left it comes: the next counter-clockwise."""
    bearings = {name: _bearing(connections, lanes) for name, connections in incoming.items()}
    found: dict[_Approach, _Approach] = {}
    for name, bearing in bearings.items():
        rest = {other: its for other, its in bearings.items() if other != name}
        others = {other: (its - bearing) % (2.0 * math.pi) for other, its in rest.items()}
        nearest = min(others, key=others.__getitem__, default=None)
        if nearest is not None and others[nearest] <= LEFT_OF_RAD:
            found[name] = nearest
    return found


def _bearing(connections: list[Connection], lanes: Mapping[str, Lane]) -> float:
    """Return from where an approach comes, in radians counter-clockwise from east."""
    ends: list[Array] = [lanes[c.from_lane_id].centerline[-2:] for c in connections]
    back = np.sum([unit(end[0] - end[1]) for end in ends], axis=0)
    return math.atan2(back[1], back[0])
