"""Cut the ways of a map into the edges of its road graph."""

from __future__ import annotations

import operator
from collections.abc import Collection, Sequence
from functools import cache
from itertools import chain, pairwise
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import local_from_geo
from foretwin.contracts.provenance import Quantity
from foretwin.contracts.world import DrivingSide
from foretwin.geometry.polyline import arc_lengths
from foretwin.world_gen.countries.outlines import CountryPlace, places_of
from foretwin.world_gen.osm.driving_side import driving_sides
from foretwin.world_gen.osm.osm_map import MapError, OsmMap, OsmWay
from foretwin.world_gen.roads.barriers import closed_nodes, ended_before
from foretwin.world_gen.roads.joined_edges import joined, read_tags
from foretwin.world_gen.roads.levels import passed_over
from foretwin.world_gen.roads.road_graph import DirectedEdge, RoadEdge, RoadGraph, side_of
from foretwin.world_gen.roads.road_tags import (
    Directions,
    LaneCounts,
    directions,
    is_car_road,
    is_kept_road,
    lane_counts,
    open_to_cars,
    road_layer,
)
from foretwin.world_gen.roads.speed_limits import speed_limit

_NAMED = ("name", "named")
"""Stands for any name: that a road has one tells towns from the country."""


def build_road_graph(osm: OsmMap) -> RoadGraph:
    """Return the graph of everything a car's wheels might follow, in the map's frame.

    Ways are cut where they share a node with themselves or another kept way, and at their ends,
    and short pieces joined where that parts nothing (`joined_edges`). They end on both sides of
    what closes them to cars (`barriers`), and go on where they pass over each other (`levels`).
    Ways are taken in the order of their ids, so that edges,
    and with them all that follows, are the same for the same map.
    Raises `MapError` where the map holds no road for cars.
    """
    ways = [way for way in osm.ways.values() if is_kept_road(way.tags)]
    if not any(is_car_road(way.tags) for way in ways):
        raise MapError(f"{osm.file}: the map holds no roads for cars")
    paths = [_without_repeats(way.nodes) for way in ways]
    kept = [(way, path) for way, path in zip(ways, paths, strict=True) if len(path) >= 2]
    flat = np.fromiter(chain.from_iterable(path for _, path in kept), dtype=np.int64)
    ids, row, uses = np.unique(flat, return_inverse=True, return_counts=True)
    lat_lon = osm.locations.of(ids)
    xy_m = local_from_geo(osm.frame, lat_lon[:, 0], lat_lon[:, 1])
    begin = np.cumsum([0, *(len(path) for _, path in kept)])[:-1]
    places = places_of(lat_lon[row[begin]])
    sides = _sides(kept, places, lat_lon[row], xy_m[row])
    closed = closed_nodes(kept, flat, osm.node_tags)
    over = passed_over(kept, flat)
    cut_here = ((uses > 1) & ~np.isin(ids, list(over))) | np.isin(ids, list(closed))
    as_mapped = _edges(kept, places, sides, flat.tolist(), xy_m[row], cut_here[row])
    edges = joined(ended_before(as_mapped, closed), _kept_nodes(osm))
    at = dict(zip(ids.tolist(), xy_m.tolist(), strict=True))
    at |= _ends_before(closed, edges)
    nodes = {node for edge in edges for node in (edge.start_node, edge.end_node)}
    leaving: dict[int, list[DirectedEdge]] = {node: [] for node in sorted(nodes)}
    for edge in edges:
        leaving[edge.start_node].append(DirectedEdge(edge, False))
        leaving[edge.end_node].append(DirectedEdge(edge, True))
    return RoadGraph(
        frame=osm.frame,
        driving_side=side_of(edge for edge in edges if edge.car),
        edges=tuple(edges),
        node_xy_m={node: (at[node][0], at[node][1]) for node in leaving},
        leaving={node: tuple(directed) for node, directed in leaving.items()},
        closed_nodes=closed,
        passed_over=over,
    )


def _ends_before(closed: Collection[int], edges: Sequence[RoadEdge]) -> dict[int, list[float]]:
    """Return where roads end before closed nodes, by the nodes they have there."""
    both = {*closed, *(-node for node in closed)}
    at_start = {e.start_node: e.xy_m[0].tolist() for e in edges if e.start_node in both}
    return at_start | {e.end_node: e.xy_m[-1].tolist() for e in edges if e.end_node in both}


def _kept_nodes(osm: OsmMap) -> frozenset[int]:
    """Return the nodes that are junctions by themselves."""
    return frozenset(
        node for node, tags in osm.node_tags.items() if tags.get("highway") == "mini_roundabout"
    )


def _without_repeats(nodes: tuple[int, ...]) -> tuple[int, ...]:
    if not any(map(operator.eq, nodes, nodes[1:])):
        return nodes
    return nodes[:1] + tuple(b for a, b in pairwise(nodes) if a != b)


def _sides(
    ways: list[tuple[OsmWay, tuple[int, ...]]],
    places: tuple[CountryPlace, ...],
    lat_lon_deg: Array,
    points: Array,
) -> tuple[DrivingSide, ...]:
    """Return on which side each way is driven; its points stand one after the other."""
    if not ways:
        return ()
    first = np.cumsum([0, *(len(path) for _, path in ways)])
    arc_m = arc_lengths(points)
    begin, length_m = first[:-1], arc_m[first[1:] - 1] - arc_m[first[:-1]]
    return driving_sides([way.tags for way, _ in ways], places, lat_lon_deg[begin], length_m)


class _Meaning(NamedTuple):
    """What a way's tags mean to a driver."""

    allowed: Directions
    lanes: LaneCounts
    limits: tuple[Quantity, Quantity]
    """Along the nodes and against them."""
    layer: int
    car: bool


def _meaning(items: frozenset[tuple[str, str]], country: str) -> _Meaning:
    tags = dict(items)
    allowed = directions(tags)
    car = is_car_road(tags) and open_to_cars(tags)
    limits = speed_limit(tags, country), speed_limit(tags, country, reverse=True)
    return _Meaning(allowed, lane_counts(tags, allowed), limits, road_layer(tags), car)


def _edges(
    ways: list[tuple[OsmWay, tuple[int, ...]]],
    places: tuple[CountryPlace, ...],
    sides: tuple[DrivingSide, ...],
    nodes: list[int],
    points: Array,
    shared: npt.NDArray[np.bool_],
) -> list[RoadEdge]:
    """Return the edges of ways whose nodes stand one after the other in `nodes` and `points`."""
    points.setflags(write=False)
    first = np.cumsum([0, *(len(path) for _, path in ways)])
    steps = np.hypot(*np.diff(points, axis=0).T) if len(points) else np.zeros(0)
    cut_here = shared.copy()
    cut_here[first[:-1]] = cut_here[first[1:] - 1] = True
    cuts = np.nonzero(cut_here)[0]
    of_way = np.searchsorted(cuts, first).tolist()
    at = cuts.tolist()
    # One sum from each cut to the next; those from one way to another are not used.
    lengths = np.add.reduceat(steps, cuts[:-1]).tolist() if len(cuts) > 1 else []
    edges: list[RoadEdge] = []
    meaning = cache(_meaning)  # most ways of a town have the same tags but for their names
    for i, (way, _) in enumerate(ways):
        tags = way.tags
        named = [_NAMED] if "name" in tags else []
        means = meaning(frozenset((*read_tags(tags).items(), *named)), places[i].code)
        name = tags.get("name") or tags.get("ref", "")
        for k in range(of_way[i], of_way[i + 1] - 1):
            begin, end = at[k], at[k + 1]
            edges.append(
                RoadEdge(
                    index=len(edges),
                    way_id=way.id,
                    start_node=nodes[begin],
                    end_node=nodes[end],
                    node_ids=tuple(nodes[begin : end + 1]),
                    xy_m=points[begin : end + 1],
                    length_m=lengths[k],
                    forward=means.allowed.forward,
                    backward=means.allowed.backward,
                    car=means.car,
                    road_class=tags["highway"],
                    name=name,
                    limit_forward_mps=means.limits[0],
                    limit_backward_mps=means.limits[1],
                    lanes_forward=means.lanes.forward,
                    lanes_backward=means.lanes.backward,
                    layer=means.layer,
                    driving_side=sides[i],
                    country=places[i].code,
                    tags=tags,
                )
            )
    return edges
