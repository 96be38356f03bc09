"""The car roads between branchings, and the rings: what junctions are found in."""

from __future__ import annotations

import math
from array import array
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import msgspec
import numpy as np

from foretwin.world_gen.osm.osm_map import OsmMap
from foretwin.world_gen.roads.road_graph import DirectedEdge, EdgeKey, RoadEdge, RoadGraph
from foretwin.world_gen.roads.road_tags import RING_TAGS, is_car_road

Tags = Mapping[str, str]
STOPS = frozenset({"traffic_signals", "stop", "give_way"})
"""`highway` of the nodes at which drivers stop or give way."""


class Mark(NamedTuple):
    """A light or sign on a chain, `distance_m` from its start."""

    node: int
    tags: Tags
    distance_m: float


class Chain(NamedTuple):
    """A road from one branching to the next, over the places where only its tags change.

    `outward` and `inward` are whether cars may leave and reach `start` by it, as far as its
    first edge goes; `one_way` that they may use it one way round alone. `key` is the same for
    both directions of one chain. `x_m` and `y_m` are its points from `start` to `end`, those
    between two edges twice; `marks` its lights and signs in that order, those at its ends too.
    `name` is the name or number of its first edge that has one.
    """

    start: int
    end: int
    edges: tuple[DirectedEdge, ...]
    x_m: Sequence[float]
    y_m: Sequence[float]
    length_m: float
    key: tuple[int, int]
    outward: bool
    inward: bool
    one_way: bool
    name: str
    marks: tuple[Mark, ...]

    @property
    def link(self) -> bool:
        """Whether it is a ramp or slip road by its class."""
        return all(item.edge.road_class.endswith("_link") for item in self.edges)

    @property
    def inner_nodes(self) -> tuple[int, ...]:
        """Graph nodes between its ends."""
        return tuple([item.end_node for item in self.edges[:-1]])

    def point_at(self, distance_m: float) -> tuple[float, float]:
        """Return the point so far along it, or its end."""
        x0, y0 = self.x_m[0], self.y_m[0]
        for x1, y1 in zip(self.x_m, self.y_m, strict=True):
            step = math.hypot(x1 - x0, y1 - y0)
            if step >= distance_m and step > 0.0:
                part = distance_m / step
                return x0 + (x1 - x0) * part, y0 + (y1 - y0) * part
            distance_m -= step
            x0, y0 = x1, y1
        return x0, y0

    def bearing_rad(self, distance_m: float) -> float:
        """Return the bearing from `start` to the point `distance_m` along it."""
        x0, y0 = self.x_m[0], self.y_m[0]
        x1, y1 = self.point_at(distance_m)
        if x0 == x1 and y0 == y1:
            x1, y1 = self.point_at(self.length_m / 2.0)
        return math.atan2(y1 - y0, x1 - x0)


class Ring(msgspec.Struct, frozen=True, kw_only=True):
    """Ways tagged as one roundabout or circular junction; `nodes` are its graph nodes."""

    kind: str
    nodes: frozenset[int]
    edges: tuple[RoadEdge, ...]


class CarRoads(msgspec.Struct, frozen=True, kw_only=True):
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
    edges = [edge for edge in graph.edges if edge.car and edge.index not in in_ring]
    between = {edge.index for edge in edges}
    leaving: dict[int, tuple[DirectedEdge, ...]] = {}
    for node, items in graph.leaving.items():
        outward = tuple([item for item in items if item[0].index in between])
        if outward or node in on_ring:
            leaving[node] = outward
    highway = {node: tags["highway"] for node, tags in osm.node_tags.items() if "highway" in tags}
    round_about = on_ring | {node for node, word in highway.items() if word == "mini_roundabout"}
    ends = {node for node, out in leaving.items() if len(out) != 2 or node in round_about}
    stops = frozenset(node for node, word in highway.items() if word in STOPS)
    walk = _Walk(edges, leaving, ends, osm.node_tags, stops)
    return CarRoads(
        chains_from={
            node: tuple([walk.chain(item) for item in outward])
            for node, outward in leaving.items()
            if node in ends
        },
        rings=rings,
    )


class _Walk:
    """Follows chains edge by edge, each once for both of its directions."""

    def __init__(
        self,
        edges: Sequence[RoadEdge],
        leaving: Mapping[int, tuple[DirectedEdge, ...]],
        ends: set[int],
        tags: Mapping[int, Tags],
        stops: frozenset[int],
    ) -> None:
        self._leaving, self._ends, self._tags, self._stops = leaving, ends, tags, stops
        # All points in one call: one for each edge costs ten times as much. Arrays, since each
        # of thousands of lists is one more object that the garbage collector visits.
        xy_m = np.concatenate([edge.xy_m for edge in edges]) if edges else np.zeros((0, 2))
        self._x_m = array("d", xy_m[:, 0].tobytes())
        self._y_m = array("d", xy_m[:, 1].tobytes())
        self._span: dict[int, tuple[int, int]] = {}
        begin = 0
        for edge in edges:
            end = begin + len(edge.node_ids)
            self._span[edge.index] = begin, end
            begin = end
        self._known: dict[EdgeKey, Chain] = {}

    def chain(self, first: DirectedEdge) -> Chain:
        """Return the chain that begins with an edge."""
        edge, reverse = first
        found = self._known.pop((edge.index, reverse), None)
        if found is not None:
            return found
        edges = [first]
        last = first
        node = last.end_node
        while node not in self._ends:
            a, b = self._leaving[node]
            last = b if last.turns_back(a) else a
            edges.append(last)
            node = last.end_node
        there, back = self._both_ways(edges)
        self._known[(last.edge.index, not last.reverse)] = back
        return there

    def _both_ways(self, edges: list[DirectedEdge]) -> tuple[Chain, Chain]:
        """Return the chain along `edges` and the one against them."""
        x_m, y_m = array("d"), array("d")
        lengths_m = []
        names = []
        marked = False
        for edge, reverse in edges:
            begin, end = self._span[edge.index]
            xs, ys = self._x_m[begin:end], self._y_m[begin:end]
            if reverse:
                xs.reverse()
                ys.reverse()
            x_m += xs
            y_m += ys
            lengths_m.append(edge.length_m)
            if edge.name:
                names.append(edge.name)
            marked = marked or not self._stops.isdisjoint(edge.node_ids)
        there = self._chain(edges, x_m, y_m, sum(lengths_m), names[0] if names else "", marked)
        against = [item.back for item in reversed(edges)]
        lengths_m.reverse()
        name = names[-1] if names else ""
        back = self._chain(against, x_m[::-1], y_m[::-1], sum(lengths_m), name, marked)
        return there, back

    def _chain(
        self,
        edges: list[DirectedEdge],
        x_m: array[float],
        y_m: array[float],
        length_m: float,
        name: str,
        marked: bool,
    ) -> Chain:
        first, last = edges[0], edges[-1]
        outward, inward = first.allowed, first.back.allowed
        a, b = first.edge.index, last.edge.index
        return Chain(
            first.start_node,
            last.end_node,
            tuple(edges),
            x_m,
            y_m,
            length_m,
            (a, b) if a <= b else (b, a),
            outward,
            inward,
            outward != inward,
            name,
            tuple(self._marks(edges, x_m, y_m)) if marked else (),
        )

    def _marks(
        self, edges: list[DirectedEdge], x_m: array[float], y_m: array[float]
    ) -> Iterator[Mark]:
        ids = [node for item in edges for node in item.node_ids]
        along_m = 0.0
        x0, y0 = x_m[0], y_m[0]
        for node, x, y in zip(ids, x_m, y_m, strict=True):
            along_m += math.hypot(x - x0, y - y0)
            x0, y0 = x, y
            if node in self._stops:
                yield Mark(node, self._tags[node], along_m)


def _ring_kind(edge: RoadEdge) -> str | None:
    kind = edge.tags.get("junction")
    return kind if kind in RING_TAGS and is_car_road(edge.tags) else None


def _rings(edges: list[RoadEdge]) -> Iterator[Ring]:
    """Yield the connected groups of ring edges of one kind, by their smallest node id."""
    for kind in sorted(RING_TAGS):
        touching: dict[int, list[RoadEdge]] = {}
        for edge in edges:
            if edge.tags["junction"] == kind:
                touching.setdefault(edge.start_node, []).append(edge)
                touching.setdefault(edge.end_node, []).append(edge)
        while touching:
            group: dict[int, RoadEdge] = {}
            nodes: set[int] = set()
            waiting = {min(touching)}
            while waiting:
                node = waiting.pop()
                nodes.add(node)
                for edge in touching.pop(node):
                    group[edge.index] = edge
                    waiting |= {edge.start_node, edge.end_node} - nodes
            members = tuple(group[index] for index in sorted(group))
            yield Ring(kind=kind, nodes=frozenset(nodes), edges=members)
