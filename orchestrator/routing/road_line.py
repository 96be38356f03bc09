"""Which line of the map the car drives along, where there is no doubt which: for its position.

Nothing is offered where the car may be on another road, where roads bend or meet, where it drives
beside the road's direction, or where its position is better than any map.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import VehicleState
from foretwin.contracts.frames import GeoPoint, geo_from_local, geo_from_local_yaw, wrap_angle
from foretwin.geometry.polyline import arc_lengths
from foretwin.orchestrator.routing.map_matching import Match
from foretwin.orchestrator.routing.road_index import NearEdge, legality
from foretwin.orchestrator.routing.route import Route
from foretwin.telemetry.estimator.map_aid import RoadLine
from foretwin.world_gen.lanes.cross_section import cross_section
from foretwin.world_gen.roads.road_graph import DirectedEdge, EdgeKey, RoadGraph

EVERY_M = 5.0
MAP_STD_M = 1.2
"""How far a drawn road lies beside the real one: OpenStreetMap where aerial pictures are good."""
IN_LANE_STD_M = 0.4
UNTAGGED_STD_M = 0.6
"""More, where nobody has counted the lanes: parked cars, a road without a middle line."""
HEADING_STD_RAD = math.radians(2.0)
_ROUGH_M = 0.5
_SLOWEST_MPS = 2.0
_HALF_WINDOW_M = 12.0
_MOST_BEND_RAD = math.radians(12.0)
_MOST_OFF_RAD, _MOST_OFF_EVER_RAD = math.radians(6.0), math.radians(15.0)
_LIKE_RAD = math.radians(30.0)
_MOST_KNOWN = 2000
_SURE = 3.0
"""Standard deviations by which the car must be away from any other road that runs alike."""


class _LateralPosition(NamedTuple):
    """Where one direction drives on a road: left of its line, and the standard deviation."""

    left_m: float
    spread_m: float


class RoadLines:
    """Offers lines to the estimator; about one for every 5 m driven."""

    def __init__(self, graph: RoadGraph) -> None:
        self._graph = graph
        self._sides: dict[EdgeKey, _LateralPosition] = {}
        self._offered_xy: Array | None = None

    def near(
        self,
        state: VehicleState,
        xy_m: Array,
        match: Match,
        route: Route,
        s_m: float,
        *,
        roads_near: Sequence[NearEdge],
    ) -> RoadLine | None:
        """Return the line at a state's place `xy_m` (2,) in the graph's frame, None in doubt."""
        std_m = state.position_std_m
        if std_m is None or std_m <= _ROUGH_M or state.speed_mps < _SLOWEST_MPS:
            return None
        before = self._offered_xy
        if before is not None and math.hypot(*(xy_m - before)) < EVERY_M:
            return None
        edge = match.directed_edge
        place = route.index_at(s_m)
        if not match.confident or legality(edge) != "car":
            return None
        if route.edges[place].key != edge.key or self._turns(state, match):
            return None
        course = _straight(route, s_m)
        side = self._side(edge)
        off_m = match.lateral_m - side.left_m
        if course is None or abs(off_m) > _SURE * math.hypot(std_m, side.spread_m):
            return None
        known = {e.edge.index for e in route.edges[max(0, place - 2) : place + 3]}
        others = [near for near in roads_near if near.directed_edge.edge.index not in known]
        if self._another_road(others, std_m, course):
            return None
        self._offered_xy = xy_m
        left = np.array([-math.sin(course), math.cos(course)])
        point = xy_m - off_m * left
        lat, lon = geo_from_local(self._graph.frame, point)
        yaw = geo_from_local_yaw(self._graph.frame, course, point)
        return RoadLine(
            GeoPoint(float(lat), float(lon)), float(yaw), side.spread_m, HEADING_STD_RAD
        )

    @staticmethod
    def _turns(state: VehicleState, match: Match) -> bool:
        """Whether the car drives across the road's direction, as in a turn."""
        doubt = 2.0 * (state.yaw_std_rad or 0.0)
        return abs(match.heading_off_rad) > min(_MOST_OFF_RAD + doubt, _MOST_OFF_EVER_RAD)

    def _side(self, directed: DirectedEdge) -> _LateralPosition:
        key = directed.key
        if key not in self._sides:
            while len(self._sides) >= _MOST_KNOWN:
                del self._sides[next(iter(self._sides))]
            self._sides[key] = _side_of(directed)
        return self._sides[key]

    def _another_road(self, others: Sequence[NearEdge], std_m: float, course_rad: float) -> bool:
        """Whether the car may be on one of these instead, which runs alike beside it."""
        for near in others:
            directed = near.directed_edge
            if abs(math.remainder(near.heading_rad - course_rad, math.tau)) > _LIKE_RAD:
                continue
            if not directed.allowed or not 0.0 < near.s_m < directed.edge.length_m - 1e-6:
                continue  # the wrong way, or it begins or ends before or behind the car
            side = self._side(directed)
            if abs(near.lateral_m - side.left_m) < _SURE * math.hypot(std_m, side.spread_m):
                return True
        return False


def _straight(route: Route, s_m: float) -> float | None:
    """Return the route's direction at `s_m`, None where it bends there or ends."""
    begin, end = s_m - _HALF_WINDOW_M, s_m + _HALF_WINDOW_M
    first, last = route.index_at(begin), route.index_at(end)
    if end > route.end_m or begin < route.origin_m:
        return None
    line = route.line(first, last)
    arc = float(route.start_m[first]) + arc_lengths(line)
    legs = np.diff(line, axis=0)
    inside = (arc[1:] > begin) & (arc[:-1] < end) & (np.diff(arc) > 0.5)
    course = np.arctan2(legs[inside, 1], legs[inside, 0])
    here = np.searchsorted(arc[1:-1], s_m)
    at = math.atan2(legs[here, 1], legs[here, 0])
    bend = np.abs(wrap_angle(course - at))
    return None if bend.size == 0 or bend.max() > _MOST_BEND_RAD else at


def _side_of(directed: DirectedEdge) -> _LateralPosition:
    """Return the middle of the lanes driven this way, any of which the car may be in."""
    section = cross_section(directed.edge)
    lanes = section.along(reverse=directed.reverse).abreast
    lefts = np.array([lane.left_m for lane in lanes]) if lanes else np.zeros(1)
    if directed.reverse:
        lefts = -lefts
    unknown_m = 0.0 if directed.lanes.source == "tagged" else UNTAGGED_STD_M
    spread_m = math.sqrt(MAP_STD_M**2 + IN_LANE_STD_M**2 + unknown_m**2 + float(lefts.var()))
    return _LateralPosition(float(lefts.mean()), spread_m)
