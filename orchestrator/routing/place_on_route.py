"""Where on a route a match lies, or a road that is nearly as likely."""

from __future__ import annotations

from typing import NamedTuple

from foretwin.orchestrator.routing.edge_parts import place_on
from foretwin.orchestrator.routing.map_matching import Match
from foretwin.orchestrator.routing.route import Route

_LOOK_BACK_EDGES, _LOOK_AHEAD_M = 4, 300.0
_AS_LIKELY_M = 50.0
"""A place on the route farther from the last one is another passage of it."""


class FoundOnRoute(NamedTuple):
    """An edge of a route by its number, and the position along the route."""

    place: int
    s_m: float


def locate(route: Route, last: FoundOnRoute, match: Match) -> FoundOnRoute | None:
    """Return where on the route a match lies, near the last place; None where it is elsewhere."""
    best: tuple[float, int, float] | None = None
    for place in range(max(0, last.place - _LOOK_BACK_EDGES), len(route.edges)):
        start_m = float(route.start_m[place])
        if start_m > last.s_m + _LOOK_AHEAD_M:
            break
        edge = route.edges[place]
        if edge.edge.index != match.directed_edge.edge.index:
            continue
        s_on_edge = match.s_on_edge_m
        if edge.reverse != match.directed_edge.reverse:
            if match.direction_known:
                continue
            s_on_edge = match.directed_edge.edge.length_m - s_on_edge
        at_m = place_on(edge, s_on_edge)
        if at_m is None:
            continue
        s_m = start_m + at_m
        found = (abs(s_m - last.s_m), place, s_m)
        best = found if best is None else min(best, found)
    return None if best is None else FoundOnRoute(best[1], best[2])


def as_likely(route: Route, last: FoundOnRoute, match: Match) -> FoundOnRoute | None:
    """Return the place on the route that is nearly as likely as a match off it, if there is one.

    Where two roads part at a small angle, they are alike for longer than patience lasts.
    """
    for near in match.rivals:
        rival = match._replace(directed_edge=near.directed_edge, s_on_edge_m=near.s_m)
        found = locate(route, last, rival)
        if found is not None and abs(found.s_m - last.s_m) < _AS_LIKELY_M:
            return found
    return None
