"""Cut the ways of a map into the edges of its road graph."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import rustworkx

from contracts.frames import local_from_geo
from world_gen.driving_side import driving_side
from world_gen.osm_map import MapError, OsmMap, OsmWay
from world_gen.road_graph import DirectedEdge, RoadEdge, RoadGraph
from world_gen.road_tags import (
    directions,
    is_car_road,
    is_kept_road,
    lane_counts,
    open_to_cars,
    road_layer,
    speed_limit,
)


def build_road_graph(osm: OsmMap) -> RoadGraph:
    """Return the graph of everything a car's wheels might follow, in the map's frame.

    Ways are cut where they share a node with themselves or another kept way, and at their ends.
    Ways are taken in the order of their ids, so that edges, and with them all that follows, are
    the same for the same map. Raises `MapError` where the map holds no road for cars.
    """
    ways = [way for way in osm.ways.values() if is_kept_road(way.tags)]
    if not any(is_car_road(way.tags) for way in ways):
        raise MapError(f"{osm.file}: the map holds no roads for cars")
    paths = [_without_repeats(way.nodes) for way in ways]
    uses = Counter(node for path in paths for node in path)
    row = {node: index for index, node in enumerate(uses)}
    lat_lon = np.array([osm.locations[node] for node in row], dtype=np.float64)
    xy_m = local_from_geo(osm.frame, lat_lon[:, 0], lat_lon[:, 1])

    edges: list[RoadEdge] = []
    for way, path in zip(ways, paths, strict=True):
        if len(path) >= 2:
            _cut(way, path, uses, row, xy_m, edges)
    nodes = {node for edge in edges for node in (edge.start_node, edge.end_node)}
    leaving: dict[int, list[DirectedEdge]] = {node: [] for node in sorted(nodes)}
    for edge in edges:
        leaving[edge.start_node].append(DirectedEdge(edge, False))
        leaving[edge.end_node].append(DirectedEdge(edge, True))
    return RoadGraph(
        frame=osm.frame,
        driving_side=driving_side(osm),
        edges=tuple(edges),
        node_xy_m={
            node: (float(xy_m[row[node], 0]), float(xy_m[row[node], 1])) for node in leaving
        },
        leaving={node: tuple(directed) for node, directed in leaving.items()},
    )


def _without_repeats(nodes: tuple[int, ...]) -> tuple[int, ...]:
    return nodes[:1] + tuple(b for a, b in pairwise(nodes) if a != b)


def _cut(
    way: OsmWay,
    path: tuple[int, ...],
    uses: Mapping[int, int],
    row: Mapping[int, int],
    xy_m: np.ndarray[Any, np.dtype[np.float64]],
    edges: list[RoadEdge],
) -> None:
    tags = way.tags
    allowed = directions(tags)
    lanes = lane_counts(tags, allowed)
    limit = speed_limit(tags)
    layer = road_layer(tags)
    car = is_car_road(tags) and open_to_cars(tags)
    name = tags.get("name") or tags.get("ref", "")
    points = xy_m[[row[node] for node in path]]
    points.setflags(write=False)
    steps = np.diff(points, axis=0)
    along_m = np.concatenate([[0.0], np.cumsum(np.hypot(steps[:, 0], steps[:, 1]))])
    last = len(path) - 1
    cuts = [i for i, node in enumerate(path) if i in (0, last) or uses[node] > 1]
    for begin, end in pairwise(cuts):
        edges.append(
            RoadEdge(
                index=len(edges),
                way_id=way.id,
                start_node=path[begin],
                end_node=path[end],
                node_ids=path[begin : end + 1],
                xy_m=points[begin : end + 1],
                length_m=float(along_m[end] - along_m[begin]),
                forward=allowed.forward,
                backward=allowed.backward,
                car=car,
                road_class=tags["highway"],
                name=name,
                speed_limit_mps=limit,
                lanes_forward=lanes.forward,
                lanes_backward=lanes.backward,
                layer=layer,
                tags=tags,
            )
        )


class RoutingGraph(NamedTuple):
    """A rustworkx digraph whose nodes carry OSM ids and whose edges carry `DirectedEdge`s."""

    digraph: Any
    index_of: Mapping[int, int]
    """rustworkx index of each OSM node."""


def routing_graph(graph: RoadGraph, *, allowed_only: bool = True) -> RoutingGraph:
    """Return the graph for shortest paths; nodes in the order of their OSM ids.

    With `allowed_only` false it also holds the directions in which cars may not drive, for
    drives older or newer than the map.
    """
    digraph = rustworkx.PyDiGraph(multigraph=True)
    nodes = list(graph.leaving)
    index_of = dict(zip(nodes, digraph.add_nodes_from(nodes), strict=True))
    digraph.add_edges_from(
        [
            (index_of[edge.start_node], index_of[edge.end_node], edge)
            for node in nodes
            for edge in graph.leaving[node]
            if edge.allowed or not allowed_only
        ]
    )
    return RoutingGraph(digraph, index_of)
