"""A way over the map's roads from a start to a goal that another program gives as two poses."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import RoutePose
from foretwin.contracts.frames import local_from_geo, local_from_geo_yaw, wrap_angle
from foretwin.geometry.polyline import locate, points_at
from foretwin.orchestrator.routing.line_matching import match_line
from foretwin.orchestrator.routing.road_index import (
    NearEdge,
    RoadIndex,
    legality,
    project,
)
from foretwin.orchestrator.routing.route import Route, RouteError
from foretwin.orchestrator.routing.shortest_paths import ShortestWays
from foretwin.world_gen.roads.road_graph import DirectedEdge
from foretwin.world_gen.roads.turn_restrictions import TurnRestrictions

NEAR_M = 30.0
"""A pose farther from every road is on none: yards and car parks are often not in the map."""
_TURNED_RAD = math.radians(60.0)


class FoundWay(NamedTuple):
    """A route, and how much of it the vehicle's own plan told; the rest is the shortest way."""

    route: Route
    planned_m: float


class WayFinder:
    """Finds ways on one map that keep to its rules, where such ones lead to the goal."""

    def __init__(self, index: RoadIndex, restrictions: TurnRestrictions) -> None:
        self._index = index
        self._ways = ShortestWays(index.graph, lawful=restrictions)

    def find(self, start: RoutePose, goal: RoutePose, *, planned_deg: Array | None) -> FoundWay:
        """Return the way from start to goal, at first along `planned_deg` (N, 2) where given.

        A plan that follows no road is passed over. Raises RouteError, one line, where a pose is on
        no road that leads its way, or where none leads from one to the other.
        """
        at_goal = self._on_road(goal, "goal")
        edges = self._along(planned_deg)
        planned_m = sum(float(one.edge.length_m) for one in edges)
        if planned_deg is not None and edges:
            from_m = project(edges[0], self._xy_m(*planned_deg[0])).s_m
        else:
            at_start = self._on_road(start, "start")
            edges, from_m = (at_start.directed_edge,), at_start.s_m
        passed = [one.key for one in edges]
        # A goal behind on the first road is come to by driving round.
        behind = int(passed[0] == at_goal.directed_edge.key and at_goal.s_m < from_m)
        if at_goal.directed_edge.key in passed[behind:]:
            last = passed.index(at_goal.directed_edge.key, behind)
            return FoundWay(Route(edges[: last + 1]), planned_m)
        rest = self._ways.between(edges[-1], at_goal.directed_edge)
        if rest is None:
            raise RouteError(f"no road leads from {_text(start)} to its goal {_text(goal)}")
        return FoundWay(Route((*edges, *rest, at_goal.directed_edge)).validate(), planned_m)

    def _on_road(self, pose: RoutePose, what: str) -> NearEdge:
        lat, lon = pose.position.lat_deg, pose.position.lon_deg
        xy_m = self._xy_m(lat, lon)
        frame = self._index.graph.frame
        yaw_rad = float(local_from_geo_yaw(frame, pose.yaw_rad, lat, lon))
        near = self._index.near(xy_m, NEAR_M)
        if not near:
            raise RouteError(f"its {what} {_text(pose)} lies within {NEAR_M:g} m of no road")
        fit = [
            one
            for one in near
            if abs(float(wrap_angle(one.heading_rad - yaw_rad))) < _TURNED_RAD
            and legality(one.directed_edge) != "against_one_way"
        ]
        if not fit:
            raise RouteError(f"its {what} {_text(pose)} lies on no road that leads its way")
        return min(fit, key=lambda one: (legality(one.directed_edge) != "car", one.distance_m))

    def _xy_m(self, lat_deg: float, lon_deg: float) -> Array:
        return local_from_geo(self._index.graph.frame, lat_deg, lon_deg)

    def _along(self, planned_deg: Array | None) -> tuple[DirectedEdge, ...]:
        if planned_deg is None or len(planned_deg) < 2:
            return ()
        try:
            found = match_line(self._index.graph, planned_deg, name="plan", index=self._index)
        except RouteError:
            return ()
        return found.routes[0].edges if len(found.routes) == 1 else ()


def away_m(route: Route, xy_m: Array) -> float:
    """Return how far a point (2,) lies from a route."""
    line = route.line(0, len(route.edges) - 1)
    return float(np.hypot(*(xy_m - points_at(line, locate(line, xy_m)))))


def _text(pose: RoutePose) -> str:
    return f"{pose.position.lat_deg:.5f}, {pose.position.lon_deg:.5f}"
