"""The cheapest way from one node of the road graph to another."""

from __future__ import annotations

from itertools import pairwise

import rustworkx

from foretwin.orchestrator.routing.road_index import key_of, travel_factor
from foretwin.world_gen.roads.road_graph import DirectedEdge, RoadGraph


class ShortestWays:
    """Cheapest ways between nodes of a graph; forbidden ground counts longer than it is."""

    def __init__(self, graph: RoadGraph) -> None:
        self._network = rustworkx.PyDiGraph(multigraph=True)
        self._nodes = list(graph.node_xy_m)
        numbers = self._network.add_nodes_from(self._nodes)
        self._number = dict(zip(self._nodes, numbers, strict=True))
        for node in self._nodes:
            for directed in graph.at_node(node):
                self._network.add_edge(
                    self._number[node], self._number[directed.end_node], directed
                )

    def between(self, start_node: int, end_node: int) -> tuple[DirectedEdge, ...] | None:
        """Return the edges from one node to another, None where none lead there, () if the same."""
        if start_node == end_node:
            return ()
        start, end = self._number[start_node], self._number[end_node]
        paths = rustworkx.dijkstra_shortest_paths(
            self._network, start, target=end, weight_fn=_effort
        )
        if end not in paths:
            return None
        nodes = list(paths[end])
        return tuple(
            min(self._network.get_all_edge_data(a, b), key=lambda d: (_effort(d), key_of(d)))
            for a, b in pairwise(nodes)
        )


def _effort(directed: DirectedEdge) -> float:
    return float(directed.edge.length_m * travel_factor(directed))
