"""The road graph: OSM ways cut into edges at every node where roads meet."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple

import msgspec

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import LocalFrame
from foretwin.contracts.provenance import Quantity
from foretwin.contracts.world import DrivingSide


class RoadEdge(msgspec.Struct, frozen=True, kw_only=True):
    """A stretch of road between two graph nodes; `xy_m` (N, 2) in the map's frame.

    It is of one way, or of several that are driven alike, the longest of which is `way_id`.

    `forward` and `backward` are whether cars may drive along and against the node order.
    `car` is true for public car roads; pedestrian streets, service roads, tracks and the like
    are kept with `car` false, since a recorded drive may use them, but no junction counts them.
    """

    index: int
    way_id: int
    start_node: int
    end_node: int
    node_ids: tuple[int, ...]
    xy_m: Array
    length_m: float
    forward: bool
    backward: bool
    car: bool
    road_class: str
    name: str
    limit_forward_mps: Quantity
    limit_backward_mps: Quantity
    lanes_forward: Quantity
    lanes_backward: Quantity
    layer: int
    driving_side: DrivingSide
    tags: Mapping[str, str]
    country: str = ""
    """Code of the country where its way begins; empty where there is none."""
    part_ways: tuple[int, ...] = ()
    """Ids of the ways that it runs along, in their order, where they are several."""

    @property
    def ways(self) -> tuple[int, ...]:
        """Ids of the ways that it runs along, in their order."""
        return self.part_ways or (self.way_id,)

    @property
    def one_way(self) -> bool:
        """Whether cars may drive it one way round alone."""
        return self.forward != self.backward

    @property
    def drivable(self) -> bool:
        """Whether it is a road for cars that is open to them and no mere point."""
        return self.car and (self.forward or self.backward) and self.length_m > 0.05


EdgeKey = tuple[int, bool]
"""Index of an edge and whether it is driven in reverse."""


class DirectedEdge(NamedTuple):
    """An edge with the direction in which it is driven."""

    edge: RoadEdge
    reverse: bool

    @property
    def key(self) -> EdgeKey:
        """What stands for it in tables (its geometry is a numpy array)."""
        return self.edge.index, self.reverse

    @property
    def back(self) -> DirectedEdge:
        """The same edge in the other direction."""
        return DirectedEdge(self.edge, not self.reverse)

    def turns_back(self, onto: DirectedEdge) -> bool:
        """Return whether who drives on `onto` next has turned back in the road."""
        return onto.edge.index == self.edge.index and onto.reverse != self.reverse

    @property
    def start_node(self) -> int:
        """OSM id of the node where driving begins."""
        return self.edge.end_node if self.reverse else self.edge.start_node

    @property
    def end_node(self) -> int:
        """OSM id of the node where driving ends."""
        return self.edge.start_node if self.reverse else self.edge.end_node

    @property
    def ways(self) -> tuple[int, ...]:
        """Ids of the ways that it runs along, in driving order."""
        return self.edge.ways[::-1] if self.reverse else self.edge.ways

    @property
    def xy_m(self) -> Array:
        """Geometry (N, 2) in driving order."""
        return self.edge.xy_m[::-1] if self.reverse else self.edge.xy_m

    @property
    def node_ids(self) -> tuple[int, ...]:
        """OSM ids of the nodes (N,) in driving order."""
        return self.edge.node_ids[::-1] if self.reverse else self.edge.node_ids

    @property
    def allowed(self) -> bool:
        """Whether cars may drive this way round."""
        return self.edge.backward if self.reverse else self.edge.forward

    @property
    def speed_limit_mps(self) -> Quantity:
        """Speed limit in driving direction."""
        return self.edge.limit_backward_mps if self.reverse else self.edge.limit_forward_mps

    @property
    def lanes(self) -> Quantity:
        """Number of lanes in driving direction."""
        return self.edge.lanes_backward if self.reverse else self.edge.lanes_forward


class RoadGraph(msgspec.Struct, frozen=True, kw_only=True):
    """All edges of a map with who leaves from which node (both directions, allowed or not)."""

    frame: LocalFrame
    driving_side: DrivingSide
    """That of most roads for cars; each road has its own."""
    edges: tuple[RoadEdge, ...]
    node_xy_m: Mapping[int, tuple[float, float]]
    leaving: Mapping[int, tuple[DirectedEdge, ...]]
    """Directed edges that start at a node, in a fixed order."""
    closed_nodes: frozenset[int] = frozenset()
    """Nodes at which a road is closed to cars: it ends before them, on the one side in a node of
    this id, on the other in one of its negative."""
    passed_over: frozenset[int] = frozenset()
    """Nodes that two roads share though one passes over the other: neither begins or ends there."""

    def middle_of(self, nodes: Iterable[int]) -> tuple[float, float]:
        """Return the mean of the places of nodes."""
        points = [self.node_xy_m[node] for node in sorted(nodes)]
        x_m, y_m = sum([x for x, _ in points]), sum([y for _, y in points])
        return x_m / len(points), y_m / len(points)

    def with_edges(self, changed: Mapping[int, RoadEdge]) -> RoadGraph:
        """Return the graph with other edges at these indices, of the same nodes."""
        leaving = dict(self.leaving)
        for node in {n for edge in changed.values() for n in (edge.start_node, edge.end_node)}:
            leaving[node] = tuple(
                DirectedEdge(changed.get(leg.edge.index, leg.edge), leg.reverse)
                for leg in self.leaving[node]
            )
        edges = tuple(changed.get(edge.index, edge) for edge in self.edges)
        return msgspec.structs.replace(self, edges=edges, leaving=leaving)

    def at_node(self, node: int) -> tuple[DirectedEdge, ...]:
        """Return the directed edges that start at `node`, allowed or not."""
        return self.leaving.get(node, ())


def side_of(edges: Iterable[RoadEdge]) -> DrivingSide:
    """Return the side on which most metres of some roads are driven; right where none are."""
    right_m = sum([edge.length_m * (1 if edge.driving_side == "right" else -1) for edge in edges])
    return "right" if right_m >= 0.0 else "left"


def country_of(edges: Iterable[RoadEdge]) -> str:
    """Return the country in which most metres of some roads lie; none where none are."""
    metres: dict[str, float] = {}
    for edge in edges:
        metres[edge.country] = metres.get(edge.country, 0.0) + edge.length_m
    return max(sorted(metres), key=metres.__getitem__, default="")
