"""The junctions that the car would meet if it turned elsewhere than its route does."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from foretwin.orchestrator.routing.junctions_ahead import UpcomingJunction
from foretwin.orchestrator.routing.road_index import reach
from foretwin.world_gen.junctions.intersections import Junction
from foretwin.world_gen.roads.road_graph import DirectedEdge, EdgeKey, RoadGraph
from foretwin.world_gen.roads.turn_restrictions import TurnRestrictions


class OtherTurns:
    """Follows every legal turn from a road; remembers the answer while the road is the same."""

    def __init__(
        self,
        graph: RoadGraph,
        junction_at: Mapping[int, Junction],
        restrictions: TurnRestrictions,
    ) -> None:
        self._graph, self._restrictions = graph, restrictions
        self._junction_at = junction_at
        self._memory: tuple[tuple[EdgeKey, int, float], list[tuple[Junction, float]]] | None = None

    def junctions(
        self, starts: Iterable[tuple[DirectedEdge, float]], *, horizon_m: float
    ) -> Iterator[UpcomingJunction]:
        """Yield the junctions within `horizon_m`, at every node where they are met.

        `starts` are roads with the distance that the car still has to drive on them. Distances run
        to the junction's node.
        """
        for start, offset_m in starts:
            for junction, gap_m in self._beyond(start, horizon_m):
                distance_m = offset_m + gap_m
                if 0.0 < distance_m <= horizon_m:
                    yield UpcomingJunction(junction, distance_m)

    def _beyond(self, start: DirectedEdge, horizon_m: float) -> list[tuple[Junction, float]]:
        """Return the junctions' nodes reached from the end of `start`, with their distances."""
        memory = (start.key, start.end_node, horizon_m)
        if self._memory is None or self._memory[0] != memory:
            nodes = [(start.end_node, 0.0)]
            legal = reach(self._graph, start, limit_m=horizon_m, lawful=self._restrictions)
            for found in legal.values():
                end_m = found.gap_m + found.directed_edge.edge.length_m
                nodes.append((found.directed_edge.end_node, end_m))
            junctions = [
                (self._junction_at[node], distance_m)
                for node, distance_m in nodes
                if node in self._junction_at
            ]
            self._memory = (memory, junctions)
        return self._memory[1]
