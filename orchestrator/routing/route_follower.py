"""Knows where on its route the car is, which junctions come next and which it has passed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from foretwin.orchestrator.routing.edge_parts import TURNED_NODE, EdgePart
from foretwin.orchestrator.routing.given_routes import GivenRoutes
from foretwin.orchestrator.routing.junctions_ahead import (
    PassedJunction,
    UpcomingJunction,
    encounters,
)
from foretwin.orchestrator.routing.map_matching import Match
from foretwin.orchestrator.routing.other_turns import OtherTurns
from foretwin.orchestrator.routing.passages import Passages
from foretwin.orchestrator.routing.place_on_route import FoundOnRoute, as_likely, locate
from foretwin.orchestrator.routing.road_index import RoadIndex
from foretwin.orchestrator.routing.route import Route, extend_most_probable
from foretwin.orchestrator.routing.turning import TURNING_RAD, route_with_turn, turns_back
from foretwin.world_gen.junctions.intersections import Junction
from foretwin.world_gen.roads.road_graph import DirectedEdge, RoadGraph
from foretwin.world_gen.roads.turn_restrictions import UNRESTRICTED, TurnRestrictions

BEHIND_M = 150.0
"""Of the road already driven, what a route keeps."""
AHEAD_M = 1200.0
PATIENCE_M = 6.0
"""Off its route for so long on one road, a car has left it, however unsure the match."""


class RouteProgress(NamedTuple):
    """Where the car is on its route.

    `off_route` says that a route is given and the car is not on it, so that the way ahead is
    predicted; `passed` are the junctions passed with this update.
    """

    s_m: float
    off_route: bool
    passed: tuple[PassedJunction, ...]


class PlaceOnRoute(NamedTuple):
    """How far along its way a car is, and at which edge of the routes given."""

    s_m: float = 0.0
    given_place: int = 0


class RouteFollower:
    """Follows a car along the routes given, or along the most probable path without any."""

    def __init__(
        self,
        graph: RoadGraph,
        junctions: Sequence[Junction],
        given: Sequence[Route] = (),
        *,
        index: RoadIndex | None = None,
        restrictions: TurnRestrictions = UNRESTRICTED,
    ) -> None:
        self._graph, self._restrictions = graph, restrictions
        self._index = index or RoadIndex(graph)
        self._junction_at = {node: junction for junction in junctions for node in junction.nodes}
        self._other_turns = OtherTurns(graph, self._junction_at, restrictions)
        self._given = GivenRoutes(given)
        self._route: Route | None = None
        self._place = 0
        self._s_m = 0.0
        self._begun_m = 0.0
        self._on_given = False
        self._direction_known = False
        self._turning = False
        self._given_from = 0
        """From where on the given routes the car is looked for, while it is not on them."""
        self._given_at = 0
        """Where on the given routes the first edge of the present one lies, while on them."""
        self._doubt: Match | None = None
        self._encounters: tuple[PassedJunction, ...] = ()
        self._passages = Passages()

    def give(self, routes: Sequence[Route]) -> None:
        """Follow these from the next match on; what is driven on now is kept until they are met."""
        self._given, self._given_from, self._on_given = GivenRoutes(routes), 0, False

    @property
    def place(self) -> PlaceOnRoute:
        """Where the car was last; a route that crosses itself is not begun anew from it."""
        given_place = self._given_at + self._place if self._on_given else self._given_from
        return PlaceOnRoute(self._s_m, given_place)

    def go_on(self, place: PlaceOnRoute) -> None:
        """Look for the car from here on the routes given, and count metres on; before it is met."""
        self._s_m, self._given_from = place.s_m, place.given_place

    @property
    def route(self) -> Route:
        """The road from 150 m behind the car to at least `AHEAD_M` ahead, if roads lead on."""
        if self._route is None:
            raise LookupError("no route before the first match")
        return self._route

    def update(self, match: Match | None) -> RouteProgress | None:
        """Take the car's match; None (off the map) ends the route until the car is back."""
        if match is None:
            self._route = None
            self._doubt = None
            return None
        if self._route is None or self._turned_round(match):
            self._begin(match)
        elif (found := self._locate(match)) is not None:
            self._place, self._s_m = found
            self._doubt = None
            if not self._on_given:
                self._rejoin(match)
            if not self._on_given:
                self._turn_with(match)
        elif not self._turns_back(match) and self._leaving(match):
            self._leave(match)
        self._direction_known = match.direction_known
        self._extend()
        off_route = bool(self._given) and not self._on_given
        return RouteProgress(self._s_m, off_route, self._take_passed())

    def upcoming(self, horizon_m: float) -> tuple[UpcomingJunction, ...]:
        """Return the junctions ahead on the route within `horizon_m`, nearest first."""
        return tuple(
            UpcomingJunction(met.junction, met.centre_s_m - self._s_m)
            for met in self._encounters
            if self._s_m < met.centre_s_m <= self._s_m + horizon_m and met not in self._passages
        )

    def alternatives(self, horizon_m: float) -> tuple[UpcomingJunction, ...]:
        """Return the junctions within `horizon_m` that other legal turns lead to, nearest first.

        Distances run to the junction's first node. Both directions count while the car's own is
        unknown.
        """
        if self._route is None:
            return ()
        edge = self._route.edges[self._place]
        rest_m = float(self._route.start_m[self._place + 1]) - self._s_m
        starts = [(edge, rest_m)]
        if not self._direction_known:
            starts.append((edge.back, edge.edge.length_m - rest_m))
        known = {ahead.junction.summary.id for ahead in self.upcoming(horizon_m)}
        nearest: dict[str, UpcomingJunction] = {}
        for met in self._other_turns.junctions(starts, horizon_m=horizon_m):
            name = met.junction.summary.id
            if name in known or self._passages.has_near(met.junction, self._s_m):
                continue
            if name not in nearest or met.distance_m < nearest[name].distance_m:
                nearest[name] = met
        return tuple(sorted(nearest.values(), key=lambda a: (a.distance_m, a.junction.summary.id)))

    # --- where the car is -------------------------------------------------------------------

    def _begin(self, match: Match) -> None:
        edges: tuple[DirectedEdge, ...] = (match.directed_edge,)
        s_on_edge = match.s_on_edge_m
        self._given_from = self.place.given_place
        known = match.direction_known
        found = self._given.find(match, direction_matters=known, start=self._given_from)
        if found is not None:
            self._given_at, s_on_edge = found
            edges = self._given.edges_from(found.place)
        self._on_given = found is not None
        self._place = 0
        self._begun_m = self._s_m
        self._set_route(Route(edges, self._s_m - s_on_edge))

    def _turned_round(self, match: Match) -> bool:
        """Whether the car drives its present road the other way round than thought."""
        assert self._route is not None
        edge, new = self._route.edges[self._place], match.directed_edge
        if edge.edge.index != new.edge.index or edge.reverse == new.reverse:
            return False
        return match.direction_known and (match.confident or not self._direction_known)

    def _locate(self, match: Match) -> FoundOnRoute | None:
        """Return where on its route the car is, None where the match says that it is elsewhere."""
        assert self._route is not None
        last = FoundOnRoute(self._place, self._s_m)
        found = locate(self._route, last, match)
        if found is None and self._on_given:
            found = as_likely(self._route, last, match)
        return found

    def _turns_back(self, match: Match) -> bool:
        assert self._route is not None
        return self._on_given and turns_back(self._route, self._place, self._s_m, match)

    def _leaving(self, match: Match) -> bool:
        """Whether the car has left its route: the match is sure, or stays off for a while."""
        first = self._doubt
        if first is None or first.directed_edge.key != match.directed_edge.key:
            self._doubt = first = match
        return match.confident or abs(match.s_on_edge_m - first.s_on_edge_m) > PATIENCE_M

    def _leave(self, match: Match) -> None:
        """Cut the route where the car left it, and predict from its new road."""
        assert self._route is not None
        # That it was left shows late: the edge where it was is the one before.
        self._given_from = max(0, self.place.given_place - self._on_given)
        key = match.directed_edge.key
        best: tuple[float, int, tuple[DirectedEdge, ...]] | None = None
        for place in range(max(0, self._place - 3), min(self._place + 3, len(self._route.edges))):
            edge = self._route.edges[place]
            reached = self._index.reached(edge).get(key) if edge.end_node != TURNED_NODE else None
            if reached is None:
                continue
            s_m = float(self._route.start_m[place + 1]) + reached.gap_m + match.s_on_edge_m
            effort = abs(s_m - self._s_m) + (reached.effort_m - reached.gap_m)
            if best is None or effort < best[0]:
                best = (effort, place, reached.via)
        if best is None:
            self._begun_m = self._s_m
            new = Route((match.directed_edge,), self._s_m - match.s_on_edge_m)
            self._place = 0
        else:
            _, place, via = best
            edges = (*self._route.edges[: place + 1], *via, match.directed_edge)
            new = Route(edges, self._route.origin_m)
            self._place = len(edges) - 1
            self._s_m = float(new.start_m[self._place]) + match.s_on_edge_m
        self._on_given = False
        self._doubt = None
        self._set_route(new)
        self._rejoin(match)

    def _turn_with(self, match: Match) -> None:
        """Predict the turn that the car's heading shows, and drop it when the heading does."""
        assert self._route is not None
        off_rad = match.heading_off_rad
        turned = route_with_turn(self._graph, self._route, self._place, self._s_m, off_rad)
        if turned is not None:
            self._turning = True
            self._set_route(turned)
        elif self._turning and abs(off_rad) < TURNING_RAD / 3.0:
            self._turning = False
            self._set_route(Route(self._route.edges[: self._place + 1], self._route.origin_m))

    def _rejoin(self, match: Match) -> None:
        """Take the given route up again where the car is back on it."""
        found = self._given.find(match, start=self._given_from)
        if found is None:
            return
        assert self._route is not None
        first, *rest = self._given.edges_from(found.place)
        if isinstance(first.edge, EdgePart):
            self._begin(match)
            return
        self._on_given = True
        self._given_at = found.place - self._place
        self._set_route(Route((*self._route.edges[: self._place + 1], *rest), self._route.origin_m))

    # --- what lies ahead --------------------------------------------------------------------

    def _set_route(self, route: Route) -> None:
        self._route = self._extended(route)
        self._encounters = tuple(encounters(self._route, self._junction_at))

    def _extended(self, route: Route) -> Route:
        until_m = self._s_m + AHEAD_M + 200.0
        return extend_most_probable(
            self._graph, route, until_m=until_m, restrictions=self._restrictions
        )

    def _extend(self) -> None:
        """Keep enough road ahead and little behind; neither changes what is already foreseen."""
        assert self._route is not None
        route = self._route
        drop = route.index_at(self._s_m - BEHIND_M)
        drop = min(drop, self._place)
        grown = route
        if route.end_m < self._s_m + AHEAD_M:
            grown = self._extended(route)
        if drop:
            grown = Route(grown.edges[drop:], float(grown.start_m[drop]))
            self._place -= drop
            self._given_at += drop
        if grown is not route:
            self._route = grown
            self._encounters = tuple(encounters(grown, self._junction_at))

    def _take_passed(self) -> tuple[PassedJunction, ...]:
        passed: list[PassedJunction] = []
        for met in self._encounters:
            if met.from_m > self._s_m:
                break
            known = met in self._passages
            if not known and self._begun_m < met.centre_s_m <= self._s_m:
                passed.append(met)
                known = True
            # Who begins within a junction, past its centre, has passed it already.
            if known or met.centre_s_m <= self._begun_m < met.to_m:
                self._passages.add(met, driven_to_m=self._s_m)
        return tuple(passed)
