"""Paths of a World that meet the ego's path, and straight stand-ins where a World offers none."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import shapely

from contracts.arrays import Array
from contracts.frames import wrap_angle
from contracts.simulation import ActorKind
from contracts.world import World
from sim_worker.planners.path import FrenetPath

_MIN_AHEAD_M = 3.0
_MAX_AHEAD_M = 150.0
_BEFORE_M = 150.0
"""Actors come from beyond the World's edge where they must."""
_FALLBACK_AHEAD_M = 25.0
_CROSSING_RAD = (math.radians(40.0), math.radians(140.0))


class Conflict(NamedTuple):
    """An actor's path and where it meets the ego's: arc lengths on either path."""

    path: FrenetPath
    ego_arc_m: float
    actor_arc_m: float
    invented: bool
    """True where the World has no such path and a straight line stands in."""


class CrossingPaths:
    """All paths through a World's junction, ready to be met with an ego path."""

    def __init__(self, world: World | None) -> None:
        self._routes = [] if world is None else _routes(world)
        self._lines = np.array([shapely.LineString(route) for route in self._routes], dtype=object)
        self._paths: dict[int, FrenetPath] = {}

    def conflicts(
        self, ego: FrenetPath, *, from_arc_m: float
    ) -> dict[ActorKind, tuple[Conflict, ...]]:
        """Return the crossing and oncoming paths that meet `ego` ahead of `from_arc_m`.

        The kind follows from the actor's heading where it comes from against the ego's. Order is
        the World's; where a kind has none, one straight line is invented.
        """
        found: dict[ActorKind, list[Conflict]] = {"crossing": [], "oncoming": []}
        start = from_arc_m + _MIN_AHEAD_M
        arcs = np.arange(start, max(start + 10.0, min(ego.length_m, start + _MAX_AHEAD_M)), 1.0)
        ahead = shapely.LineString(ego.point_at(arcs))
        for index in np.flatnonzero(shapely.intersects(self._lines, ahead)):
            meeting = shapely.intersection(self._lines[index], ahead)
            point = np.asarray(shapely.get_coordinates(meeting)[:1])
            path = self._path(int(index))
            ego_arc = float(ego.locate(point).arc_m[0])
            actor_arc = float(path.locate(point).arc_m[0])
            origin = path.pose_at(np.array([max(actor_arc - 20.0, 0.0)])).yaw_rad
            towards = ego.pose_at(np.array([max(ego_arc - 20.0, from_arc_m)])).yaw_rad
            angle = abs(float(wrap_angle(origin - towards)[0]))
            if angle >= _CROSSING_RAD[1]:
                found["oncoming"].append(Conflict(path, ego_arc, actor_arc, False))
            elif angle >= _CROSSING_RAD[0]:
                found["crossing"].append(Conflict(path, ego_arc, actor_arc, False))
        place = _conflict_place(ego, from_arc_m)
        return {
            "crossing": tuple(found["crossing"]) or (_straight(ego, place, math.radians(90.0)),),
            "oncoming": tuple(found["oncoming"]) or (_straight(ego, place, math.radians(160.0)),),
        }

    def _path(self, index: int) -> FrenetPath:
        if index not in self._paths:
            self._paths[index] = FrenetPath(self._routes[index], before_m=_BEFORE_M)
        return self._paths[index]


def _routes(world: World) -> list[Array]:
    """Join every connection with the lanes before and after it."""
    lanes = {lane.id: lane.centerline for lane in world.lanes}
    empty = np.zeros((0, 2))
    routes = []
    for connection in world.connections:
        parts = (
            lanes.get(connection.from_lane_id, empty),
            connection.centerline,
            lanes.get(connection.to_lane_id, empty),
        )
        route = np.concatenate(parts)
        if len(route) >= 2 and np.ptp(route, axis=0).max() > 1.0:
            routes.append(route)
    return routes


def _conflict_place(ego: FrenetPath, from_arc_m: float) -> float:
    """Return the arc length of the junction's centre if it lies ahead, else a little ahead."""
    centre = float(ego.locate(np.zeros((1, 2))).arc_m[0])
    if from_arc_m + _MIN_AHEAD_M < centre < from_arc_m + _MAX_AHEAD_M:
        return centre
    return from_arc_m + _FALLBACK_AHEAD_M


def _straight(ego: FrenetPath, ego_arc_m: float, angle_rad: float) -> Conflict:
    """Return a straight line through the ego's path, turned left by `angle_rad`."""
    pose = ego.pose_at(np.array([ego_arc_m]))
    heading = float(pose.yaw_rad[0]) + angle_rad
    direction = np.array([math.cos(heading), math.sin(heading)])
    ends = pose.xy_m[0] + np.array([-100.0, 100.0])[:, None] * direction
    return Conflict(FrenetPath(ends), ego_arc_m, 100.0, True)
