"""Driveways, parking aisles and other service roads as roads that junctions count, by choice."""

from __future__ import annotations

from collections.abc import Iterable

import msgspec

from foretwin.world_gen.roads.road_graph import RoadEdge, RoadGraph
from foretwin.world_gen.roads.road_tags import ONEWAY


def with_service_roads(graph: RoadGraph) -> RoadGraph:
    """Return the graph with every service road that is open to cars counted as a car road."""
    return with_roads(graph, open_service_roads(graph.edges))


def open_service_roads(edges: Iterable[RoadEdge]) -> tuple[int, ...]:
    """Return the indices, ascending, of those edges that are service roads open to cars."""
    service = (edge for edge in edges if edge.road_class == "service" and not edge.car)
    return tuple(sorted({edge.index for edge in service if edge.forward or edge.backward}))


def with_roads(graph: RoadGraph, edges: Iterable[int]) -> RoadGraph:
    """Return the graph with these edges, say those of a route, counted as car roads.

    They are open to the car that is to use them even where the public may not drive.

    Junctions and Worlds found in it have the places where they meet a street; edges keep their
    indices, so what was found in one graph holds in the other.
    """
    added = {index for index in edges if not graph.edges[index].car}
    return graph.with_edges({i: _opened(graph.edges[i]) for i in added}) if added else graph


def _opened(edge: RoadEdge) -> RoadEdge:
    if edge.forward or edge.backward:
        return msgspec.structs.replace(edge, car=True)
    forward, backward = ONEWAY.get(edge.tags.get("oneway", ""), (True, True))
    return msgspec.structs.replace(edge, car=True, forward=forward, backward=backward)
