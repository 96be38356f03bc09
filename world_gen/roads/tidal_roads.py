"""Tidal roads: driven one way at a time, and a map does not tell which way for the moment.

OpenStreetMap calls them `oneway=reversible`; mappers draw their parts either way round, so that
the parts are led one through another here. What changes every few minutes (`oneway=alternating`) is
driven both ways by who waits.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

import msgspec

from foretwin.world_gen.roads.headings import dot, heading_out
from foretwin.world_gen.roads.road_graph import DirectedEdge, EdgeKey, RoadEdge, RoadGraph
from foretwin.world_gen.roads.road_tags import Directions, is_tidal, lane_counts

_HEADING_OVER_M = 15.0
_SAME_WAY_COS = 0.5
"""Roads whose directions at a node differ less go the same way from there, and on opposite ones
traffic goes from one into the other."""


def with_tides(graph: RoadGraph, driven: Iterable[EdgeKey] = ()) -> RoadGraph:
    """Return the graph with tidal roads driven one way.

    That is as a route drives them, whose edges are `driven`, else as most metres of those that lead
    one into another are drawn: a guess.
    """
    turned: dict[int, RoadEdge] = {}
    routed = list(driven)
    for group in _groups(graph):
        told = [group[index] == reverse for index, reverse in routed if index in group]
        as_led_m = sum(
            [graph.edges[i].length_m * (1 if not reverse else -1) for i, reverse in group.items()]
        )
        along = told[0] if told else as_led_m >= 0.0
        turned |= {i: _one_way(graph.edges[i], reverse == along) for i, reverse in group.items()}
    return graph.with_edges(turned) if turned else graph


def tidal_notes(edges: Iterable[RoadEdge]) -> Iterator[str]:
    """Say of tidal roads which way they are driven here."""
    for edge in edges:
        if is_tidal(edge.tags):
            way = "along its nodes" if edge.forward else "against its nodes"
            yield (
                f"way {edge.way_id}: driven one way at a time, which one the map does not tell "
                f"(oneway=reversible); here {'both ways' if not edge.one_way else way}"
            )


def _one_way(edge: RoadEdge, reverse: bool) -> RoadEdge:
    allowed = Directions(forward=not reverse, backward=reverse)
    lanes = lane_counts(edge.tags, allowed)
    return msgspec.structs.replace(
        edge,
        forward=allowed.forward,
        backward=allowed.backward,
        lanes_forward=lanes.forward,
        lanes_backward=lanes.backward,
    )


def _groups(graph: RoadGraph) -> Iterator[Mapping[int, bool]]:
    """Yield tidal roads that lead one into another, by edge index, with whether they are then
    driven against their nodes."""
    tidal = {e.index for e in graph.edges if e.forward and e.backward and is_tidal(e.tags)}
    while tidal:
        group: dict[int, bool] = {}
        waiting = [DirectedEdge(graph.edges[min(tidal)], False)]
        while waiting:
            here = waiting.pop()
            if here.edge.index not in group:
                group[here.edge.index] = here.reverse
                waiting += _led_on(graph, here, tidal)
                waiting += [leg.back for leg in _led_on(graph, here.back, tidal)]
        tidal -= group.keys()
        yield group


def _led_on(graph: RoadGraph, here: DirectedEdge, tidal: set[int]) -> list[DirectedEdge]:
    """Return how the other tidal roads at the end of one are driven if it is driven so."""
    legs = [leg for leg in graph.at_node(here.end_node) if leg.edge.index in tidal]
    others = [leg for leg in legs if leg.edge.index != here.edge.index]
    if len(others) == 1:
        return others
    back = heading_out(here.back, _HEADING_OVER_M)
    cosines = [dot(heading_out(leg, _HEADING_OVER_M), back) for leg in others]
    onward = [leg for leg, cos in zip(others, cosines, strict=True) if cos < -_SAME_WAY_COS]
    beside = [leg.back for leg, cos in zip(others, cosines, strict=True) if cos > _SAME_WAY_COS]
    return onward + beside
