"""A map of the streets that a drawn drive takes, wrong as maps are wrong: moved, lanes unknown.

The car drives one lane of each street, drawn at random among those of its direction; the map has
the street beside where it really is by an error drawn once for each, and side streets at corners.
"""

from __future__ import annotations

import functools
import itertools
import math
from typing import NamedTuple

import msgspec
import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import VehicleState
from foretwin.orchestrator.routing.route_ahead import WayAhead
from foretwin.telemetry.estimator.map_aid import RoadLine
from foretwin.world_gen.roads.road_graph import RoadEdge, RoadGraph
from tests.orchestrator.grid_map import graph_of, road
from tests.telemetry.standin_drive import FRAME

LANE_M = 3.0
CORNER_RAD = 0.5
"""A turn beyond this is a corner, into another street; below it a street bends."""
SIDE_STREET_M = 70.0


class Leg(NamedTuple):
    """A straight stretch of the way driven, and the bend after it."""

    straight_m: float
    turn_rad: float
    radius_m: float


def town_map(legs: list[Leg], *, seed: int, error_m: float = 1.0) -> RoadGraph:
    """Return the map along `legs`, which begin in the origin towards east.

    Streets have one or two lanes each way; `error_m` is the standard deviation of how far beside
    its place each is drawn.
    """
    random = np.random.default_rng(seed)
    lines, counts = [], []
    at, yaw, across_m, count = np.zeros(2), 0.0, 0.0, 1
    for number, leg in enumerate(legs):
        if number == 0 or abs(legs[number - 1].turn_rad) > CORNER_RAD:
            count = int(random.choice([1, 1, 2]))
            # From the middle of the road to the lane driven, and what the map is wrong by.
            across_m = LANE_M * (int(random.integers(count)) + 0.5) + random.normal(0.0, error_m)
        ahead = np.array([math.cos(yaw), math.sin(yaw)])
        lines.append((at + across_m * np.array([-ahead[1], ahead[0]]), ahead))
        counts.append(count)
        at = at + leg.straight_m * ahead
        middle = at + leg.radius_m * math.copysign(1.0, leg.turn_rad) * np.array(
            [-ahead[1], ahead[0]]
        )
        cos, sin = math.cos(leg.turn_rad), math.sin(leg.turn_rad)
        at = middle + np.array([[cos, -sin], [sin, cos]]) @ (at - middle)
        yaw += leg.turn_rad
    corners = [lines[0][0] - 30.0 * lines[0][1]]
    corners += [_crossing(*one, *other) for one, other in itertools.pairwise(lines)]
    corners.append(at + 60.0 * np.array([math.cos(yaw), math.sin(yaw)]))
    edges: list[RoadEdge] = []
    for number, count in enumerate(counts):
        _street(edges, number, number + 1, corners[number], corners[number + 1], count)
        if number and abs(legs[number - 1].turn_rad) > CORNER_RAD:
            for side, way in enumerate((lines[number - 1][1], -lines[number][1])):
                end = corners[number] + SIDE_STREET_M * way
                _street(edges, number, 10_000 + 2 * number + side, corners[number], end, 1)
    return msgspec.structs.replace(graph_of(edges), frame=FRAME)


def _street(
    edges: list[RoadEdge], start: int, end: int, from_xy: Array, to_xy: Array, count: int
) -> None:
    xy = [(float(x), float(y)) for x, y in (from_xy, to_xy)]
    edges.append(road(len(edges), start, end, xy, lanes=(float(count), float(count))))


def _crossing(one: Array, along: Array, other: Array, beside: Array) -> Array:
    """Return where two lines, each through a point (2,) in a direction (2,), meet."""
    share = np.linalg.solve(np.column_stack([along, -beside]), other - one)
    crossing: Array = one + share[0] * along
    return crossing


class MapSeer:
    """Finds a car's states on a map ten times a second, as a mission does."""

    def __init__(self, way: WayAhead) -> None:
        self._way = way
        self._due_ns = 0
        self.offered = 0

    def line(self, state: VehicleState) -> RoadLine | None:
        if state.stamp_ns < self._due_ns or not state.yaw_valid:
            return None
        self._due_ns = state.stamp_ns + 100_000_000
        if self._way.locate(state) is None:
            return None
        line = self._way.road_line(state)
        self.offered += line is not None
        return line


@functools.cache
def _graph(legs: tuple[Leg, ...], seed: int, error_m: float) -> RoadGraph:
    return town_map(list(legs), seed=seed, error_m=error_m)


def seer(legs: list[Leg], *, seed: int, error_m: float = 1.0) -> MapSeer:
    """Return who knows a map of `legs`, without a route: the way is predicted."""
    return MapSeer(WayAhead(_graph(tuple(legs), seed, error_m), (), ()))
