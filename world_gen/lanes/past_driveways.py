"""Approaches past driveways: edges cut where only driveways join are one road of a World.

The graph is cut at every service road, since routes may use it. Where that is near a junction, what
is left of the approach may hold less than the junction needs of it.
"""

from __future__ import annotations

from collections.abc import Container, Mapping

import msgspec

from foretwin.world_gen.junctions.intersections import Junction
from foretwin.world_gen.roads.joined_edges import SHORT_M, alike, one_edge
from foretwin.world_gen.roads.road_graph import DirectedEdge, RoadEdge, RoadGraph


class JoinedRoads(msgspec.Struct, frozen=True):
    """Which edges of a map are one road of a World: `parts` in their order along the way, by the
    index of the first, which is that of the road."""

    parts: Mapping[int, tuple[int, ...]] = {}

    def edges(self, edges: Mapping[int, RoadEdge]) -> dict[int, RoadEdge]:
        """Return edges by index, those to be joined as one."""
        found = dict(edges)
        for road, parts in self.parts.items():
            found[road] = one_edge([found.pop(i) for i in parts], road)
        return dict(sorted(found.items()))

    def junction(self, junction: Junction) -> Junction:
        """Return a junction whose arms are of these roads."""
        road_of = {i: road for road, parts in self.parts.items() for i in parts}
        legs = [leg for arm in junction.arms for leg in arm.outward]
        if road_of.keys().isdisjoint(leg.edge.index for leg in legs):
            return junction
        arms = []
        for arm in junction.arms:
            outward = []
            for leg in arm.outward:
                index = road_of.get(leg.edge.index, leg.edge.index)
                edge = msgspec.structs.replace(leg.edge, index=index)
                outward.append(DirectedEdge(edge, leg.reverse))
            arms.append(msgspec.structs.replace(arm, outward=tuple(outward)))
        return msgspec.structs.replace(junction, arms=tuple(arms))


def past_driveways(
    graph: RoadGraph, edges: Mapping[int, RoadEdge], in_junctions: Container[int]
) -> JoinedRoads:
    """Return which of a World's edges go on from a junction past driveways, up to `SHORT_M`.

    They are driven alike. `in_junctions` are the nodes of junctions.
    """
    after: dict[int, int] = {}
    for edge in edges.values():
        for leg in (DirectedEdge(edge, False), DirectedEdge(edge, True)):
            if leg.start_node not in in_junctions:
                continue
            length_m, here = edge.length_m, leg
            while length_m < SHORT_M and here.end_node not in in_junctions:
                ahead = past_driveway(graph, here)
                if ahead is None or ahead.edge.index not in edges:
                    break
                first, second = (ahead, here) if here.reverse else (here, ahead)
                after[first.edge.index] = second.edge.index
                length_m, here = length_m + ahead.edge.length_m, ahead
    behind = set(after.values())
    found: dict[int, tuple[int, ...]] = {}
    for first_part in sorted(after.keys() - behind):
        parts = [first_part]
        while parts[-1] in after:
            parts.append(after[parts[-1]])
        if edges[parts[0]].start_node != edges[parts[-1]].end_node:
            found[first_part] = tuple(parts)
    return JoinedRoads(found)


def past_driveway(graph: RoadGraph, here: DirectedEdge) -> DirectedEdge | None:
    """Return the edge in which one goes on where only driveways join it, None where none does."""
    leaving = graph.at_node(here.end_node)
    cars = [leg for leg in leaving if leg.edge.drivable]
    if len(cars) != 2 or len(leaving) == 2:
        return None
    ahead = next((leg for leg in cars if leg.edge.index != here.edge.index), None)
    if ahead is None or ahead.reverse != here.reverse:
        return None
    return ahead if alike(here.edge, ahead.edge) else None
