"""The cheapest way over the road graph from the end of one edge to the start of another."""

from __future__ import annotations

import rustworkx

from foretwin.orchestrator.routing.road_index import U_TURN_M, legality, travel_factor
from foretwin.world_gen.roads.road_graph import DirectedEdge, RoadGraph
from foretwin.world_gen.roads.turn_restrictions import TurnRestrictions

FORBIDDEN_M = 2000.0
"""So much farther a lawful driver goes rather than turn back in the road, turn where that is
forbidden, or enter a road that is closed to cars; chosen. No more, since maps err."""


class ShortestWays:
    """Cheapest ways between edges of a graph; forbidden ground counts longer than it is.

    `lawful` are the turn restrictions for a driver who keeps to them and to what else the map
    forbids. Without them a way may be one that was driven all the same.
    """

    def __init__(self, graph: RoadGraph, *, lawful: TurnRestrictions | None = None) -> None:
        self._graph, self._lawful = graph, lawful
        # Its nodes are directed edges, since what a turn costs depends on both of them.
        self._network = rustworkx.PyDiGraph()
        edges = [edge for node in graph.node_xy_m for edge in graph.at_node(node)]
        numbers = self._network.add_nodes_from(edges)
        self._number = dict(zip((edge.key for edge in edges), numbers, strict=True))
        for number, edge in zip(numbers, edges, strict=True):
            self._join(number, edge)

    def between(self, start: DirectedEdge, goal: DirectedEdge) -> tuple[DirectedEdge, ...] | None:
        """Return the edges from the end of one to the start of another, None where none lead there.

        A goal that is the start is come to by driving round.
        """
        here, there = self._network.add_node(start), self._number[goal.key]
        self._join(here, start)
        paths = rustworkx.dijkstra_shortest_paths(
            self._network, here, target=there, weight_fn=float
        )
        self._network.remove_node(here)
        if there not in paths:
            return None
        return tuple(self._network[number] for number in list(paths[there])[1:-1])

    def _join(self, number: int, before: DirectedEdge) -> None:
        """Lead from a node of the network, of this edge, onto those that follow it."""
        onto = self._graph.at_node(before.end_node)
        self._network.add_edges_from(
            [(number, self._number[after.key], self._effort_m(before, after)) for after in onto]
        )

    def _effort_m(self, before: DirectedEdge, after: DirectedEdge) -> float:
        """Return what it costs to go from one edge onto the next, and to drive that one."""
        drive_m = float(after.edge.length_m * travel_factor(after))
        turns_back = before.turns_back(after)
        if self._lawful is None:
            return drive_m + U_TURN_M * turns_back
        enters = legality(after) not in ("car", legality(before))
        broken = turns_back + enters + (not self._lawful.step_allowed(before, after))
        return drive_m + FORBIDDEN_M * broken
