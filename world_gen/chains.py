"""The car roads between branchings, and the rings: what junctions are found in."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from world_gen.osm_map import OsmMap
from world_gen.road_graph import DirectedEdge, RoadEdge, RoadGraph
from world_gen.road_tags import RING_TAGS, is_car_road


@dataclass(frozen=True, slots=True, kw_only=True)
class Chain:
    """A road from one branching to the next, over the places where only its tags change.

    `outward` and `inward` tell whether cars may leave and reach `start` by it, as far as its
    first edge goes. `key` is the same for both directions of one chain.
    """

    start: int
    end: int
    edges: tuple[DirectedEdge, ...]
    length_m: float
    key: tuple[int, int]

    @property
    def outward(self) -> bool:
        """Whether cars may leave `start` by this chain."""
        return self.edges[0].allowed

    @property
    def inward(self) -> bool:
        """Whether cars may reach `start` by this chain."""
        first = self.edges[0]
        return first.edge.forward if first.reverse else first.edge.backward

    @property
    def one_way(self) -> bool:
        """Whether cars may use its first edge one way round alone."""
        return self.outward != self.inward

    @property
    def name(self) -> str:
        """Name or number of its first edge that has one."""
        return next((item.edge.name for item in self.edges if item.edge.name), "")

    @property
    def link(self) -> bool:
        """Whether it is a ramp or slip road by its class."""
        return all(item.edge.road_class.endswith("_link") for item in self.edges)

    @property
    def inner_nodes(self) -> tuple[int, ...]:
        """Graph nodes between its ends."""
        return tuple(item.end_node for item in self.edges[:-1])

    def points(self) -> Iterator[tuple[float, float]]:
        """Yield its points in metres, from `start` to `end`."""
        for item in self.edges:
            yield from item.xy_m.tolist()

    def nodes(self) -> Iterator[tuple[int, float]]:
        """Yield all its OSM nodes, shape nodes too, with metres from `start`."""
        along_m = 0.0
        before: tuple[float, float] | None = None
        for item in self.edges:
            ids = item.edge.node_ids[::-1] if item.reverse else item.edge.node_ids
            for node, (x_m, y_m) in zip(ids, item.xy_m.tolist(), strict=True):
                if before is not None:
                    along_m += math.hypot(x_m - before[0], y_m - before[1])
                before = (x_m, y_m)
                yield node, along_m

    def point_at(self, distance_m: float) -> tuple[float, float]:
        """Return the point so far along it, or its end."""
        points = self.points()
        x0, y0 = next(points)
        for x1, y1 in points:
            step = math.hypot(x1 - x0, y1 - y0)
            if step >= distance_m and step > 0.0:
                part = distance_m / step
                return x0 + (x1 - x0) * part, y0 + (y1 - y0) * part
            distance_m -= step
            x0, y0 = x1, y1
        return x0, y0

    def bearing_rad(self, distance_m: float) -> float:
        """Return the bearing from `start` to the point `distance_m` along it."""
        x0, y0 = next(self.points())
        x1, y1 = self.point_at(distance_m)
        if x0 == x1 and y0 == y1:
            x1, y1 = self.point_at(self.length_m / 2.0)
        return math.atan2(y1 - y0, x1 - x0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Ring:
    """Ways tagged as one roundabout or circular junction; `nodes` are its graph nodes."""

    kind: str
    nodes: frozenset[int]
    edges: tuple[RoadEdge, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class CarRoads:
    """Branchings of car roads with the chains that leave them, and the rings."""

    chains_from: Mapping[int, tuple[Chain, ...]]
    rings: tuple[Ring, ...]


def car_roads(osm: OsmMap, graph: RoadGraph) -> CarRoads:
    """Return the chains between all nodes where other than two car road ends meet, and rings.

    Ring edges belong to no chain. Roads that are closed to cars count for rings alone: a tagged
    ring is one whoever may drive in it.
    """
    ring_edges = [edge for edge in graph.edges if _ring_kind(edge) is not None]
    rings = tuple(_rings(ring_edges))
    on_ring = {node for ring in rings for node in ring.nodes}
    in_ring = {edge.index for edge in ring_edges}
    leaving = {
        node: outward
        for node, items in graph.leaving.items()
        if (
            outward := tuple(
                item for item in items if item.edge.car and item.edge.index not in in_ring
            )
        )
        or node in on_ring
    }
    mini = {
        node for node, tags in osm.node_tags.items() if tags.get("highway") == "mini_roundabout"
    }
    ends = {
        node
        for node, outward in leaving.items()
        if len(outward) != 2 or node in on_ring or node in mini
    }
    return CarRoads(
        chains_from={
            node: tuple(_follow(item, leaving, ends) for item in leaving[node])
            for node in leaving
            if node in ends
        },
        rings=rings,
    )


def _follow(
    first: DirectedEdge, leaving: Mapping[int, tuple[DirectedEdge, ...]], ends: set[int]
) -> Chain:
    edges = [first]
    while edges[-1].end_node not in ends:
        last = edges[-1]
        a, b = leaving[last.end_node]
        came_by_a = a.edge.index == last.edge.index and a.reverse != last.reverse
        edges.append(b if came_by_a else a)
    first_key, last_key = first.edge.index, edges[-1].edge.index
    return Chain(
        start=first.start_node,
        end=edges[-1].end_node,
        edges=tuple(edges),
        length_m=sum(item.edge.length_m for item in edges),
        key=(min(first_key, last_key), max(first_key, last_key)),
    )


def _ring_kind(edge: RoadEdge) -> str | None:
    kind = edge.tags.get("junction")
    return kind if kind in RING_TAGS and is_car_road(edge.tags) else None


def _rings(edges: list[RoadEdge]) -> Iterator[Ring]:
    """Yield the connected groups of ring edges of one kind, by their smallest node id."""
    for kind in sorted(RING_TAGS):
        of_kind = [edge for edge in edges if edge.tags["junction"] == kind]
        touching: dict[int, list[RoadEdge]] = {}
        for edge in of_kind:
            touching.setdefault(edge.start_node, []).append(edge)
            touching.setdefault(edge.end_node, []).append(edge)
        seen: set[int] = set()
        for first in sorted(touching):
            if first in seen:
                continue
            seen.add(first)
            group: dict[int, RoadEdge] = {}
            nodes = {first}
            waiting = [first]
            while waiting:
                for edge in touching[waiting.pop()]:
                    group[edge.index] = edge
                    for node in (edge.start_node, edge.end_node):
                        if node not in seen:
                            seen.add(node)
                            nodes.add(node)
                            waiting.append(node)
            members = tuple(group[index] for index in sorted(group))
            yield Ring(kind=kind, nodes=frozenset(nodes), edges=members)
