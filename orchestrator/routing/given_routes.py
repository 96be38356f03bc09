"""The routes that the driver gave, and where on them a road lies."""

from __future__ import annotations

from collections.abc import Sequence

from foretwin.orchestrator.routing.route import Route
from foretwin.world_gen.roads.road_graph import DirectedEdge


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
        self, directed: DirectedEdge, *, direction_matters: bool = True, start: int = 0
    ) -> int | None:
        """Return the first place of an edge from place `start` on, then from the beginning.

        Returns None for an edge on no route, or only the other way round where that matters.
        """
        for offset in range(len(self._edges)):
            place = (start + offset) % len(self._edges)
            found = self._edges[place][0]
            if found.edge.index != directed.edge.index:
                continue
            if found.reverse == directed.reverse or not direction_matters:
                return place
        return None

    def edges_from(self, place: int) -> tuple[DirectedEdge, ...]:
        """Return the edges from a place to the end of its route."""
        return self._edges[place][1]
