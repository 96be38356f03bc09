"""Places that lanes lead through, once the World's edge has cut what lies beyond."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

import msgspec

from foretwin.contracts.world import Road
from foretwin.world_gen.lanes.legs import opposed
from foretwin.world_gen.roads.road_graph import DirectedEdge


def places_led_through(
    legs: Mapping[tuple[int, bool], tuple[str, DirectedEdge]],
    begins: Iterable[tuple[int, bool]],
    ends: Iterable[tuple[int, bool]],
) -> frozenset[str]:
    """Return the places where a lane of one road ends and a lane of another goes on.

    `legs` are the places and the roads that leave them, by (edge index, reverse); `begins` and
    `ends` tell of lanes, in their driving direction, by the same. Two carriageways that part do
    not lead into each other.
    """
    into: dict[str, list[DirectedEdge]] = {}
    out_of: dict[str, list[DirectedEdge]] = {}
    for found, keys in ((out_of, set(begins)), (into, {(i, not r) for i, r in ends})):
        for key in keys & legs.keys():
            place, leg = legs[key]
            found.setdefault(place, []).append(leg)
    return frozenset(
        place
        for place in into.keys() & out_of.keys()
        if any(
            a.edge.index != b.edge.index and not opposed(a, b)
            for a in into[place]
            for b in out_of[place]
        )
    )


def without_dead_places(roads: Iterable[Road], led_through: frozenset[str]) -> Iterator[Road]:
    """Yield the roads, without the places at their ends that nothing leads through."""
    for road in roads:
        ends = [p if p in led_through else None for p in (road.from_place, road.to_place)]
        if ends == [road.from_place, road.to_place]:
            yield road
        else:
            yield msgspec.structs.replace(road, from_place=ends[0], to_place=ends[1])
