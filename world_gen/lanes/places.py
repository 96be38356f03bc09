"""Places that lanes lead through, once the World's edge has cut what lies beyond."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

import msgspec
import numpy as np

from foretwin.contracts.world import Road
from foretwin.geometry.polyline import points_at
from foretwin.world_gen.extent import MIN_PIECE_M, Extent
from foretwin.world_gen.junctions.intersections import Junction
from foretwin.world_gen.lanes.cluster import Cluster
from foretwin.world_gen.lanes.legs import opposed
from foretwin.world_gen.roads.road_graph import DirectedEdge, EdgeKey


def places_led_through(
    legs: Mapping[EdgeKey, tuple[str, DirectedEdge]],
    begins: Iterable[EdgeKey],
    ends: Iterable[EdgeKey],
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


def whole_where_led_through(
    clusters: tuple[Cluster, ...],
    made_for: tuple[Junction, ...],
    trims_m: Mapping[EdgeKey, float],
    extent: Extent,
) -> tuple[Cluster, ...]:
    """Return the clusters, none whole of junctions that no road leads through before the edge."""
    named = {junction.summary.id for junction in made_for}
    places = {
        leg.key: (c.junction.summary.id, leg)
        for c in clusters
        if c.whole and c.junction is not None and c.junction.summary.id not in named
        for leg in c.legs
    }
    if not places:
        return clusters
    ends_inside = extent.holds(np.array([leg.xy_m[-1] for _, leg in places.values()])).tolist()
    near = [
        leg
        for (_, leg), inside in zip(places.values(), ends_inside, strict=True)
        if inside
        or extent.holds(points_at(leg.xy_m, np.array([trims_m[leg.key] + MIN_PIECE_M]))).all()
    ]
    through = places_led_through(
        places,
        [leg.key for leg in near if leg.allowed],
        [leg.back.key for leg in near if leg.back.allowed],
    )
    dead = {place for place, _ in places.values()} - through
    return tuple(
        msgspec.structs.replace(c, whole=False)
        if c.junction is not None and c.junction.summary.id in dead
        else c
        for c in clusters
    )
