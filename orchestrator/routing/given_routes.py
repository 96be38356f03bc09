"""The routes that the driver gave, and where on them a road lies."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from foretwin.orchestrator.routing.edge_parts import place_on
from foretwin.orchestrator.routing.map_matching import Match
from foretwin.orchestrator.routing.route import Route
from foretwin.world_gen.roads.road_graph import DirectedEdge


class FoundOnGiven(NamedTuple):
    """The number of an edge of the given routes, and the metres along it."""

    place: int
    on_edge_m: float


class GivenRoutes:
    """The edges of all routes given, one after the other; a place is the number of an edge."""

    def __init__(self, routes: Sequence[Route]) -> None:
        self._edges = [
            (directed, route.edges[number:])
            for route in routes
            for number, directed in enumerate(route.edges)
        ]

    def __len__(self) -> int:
        return len(self._edges)

    def find(
        self, match: Match, *, direction_matters: bool = True, start: int = 0
    ) -> FoundOnGiven | None:
        """Return where a match lies, first from place `start` on, then from the beginning.

        Returns None for one on no route, or only the other way round where that matters.
        """
        edge = match.directed_edge
        for offset in range(len(self._edges)):
            place = (start + offset) % len(self._edges)
            found, s_m = self._edges[place][0], match.s_on_edge_m
            if found.edge.index != edge.edge.index:
                continue
            if found.reverse != edge.reverse:
                if direction_matters:
                    continue
                s_m = edge.edge.length_m - s_m
            if (at_m := place_on(found, s_m)) is not None:
                return FoundOnGiven(place, at_m)
        return None

    def edges_from(self, place: int) -> tuple[DirectedEdge, ...]:
        """Return the edges from a place to the end of its route."""
        return self._edges[place][1]
