"""Lanes and junctions of a World as areas: in how many lanes a car is, and whether on its way."""

from __future__ import annotations

import functools

import numpy as np
import shapely

from foretwin.contracts.arrays import Array, Flags, Indices
from foretwin.contracts.world import Connection, Lane, World
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.sim_worker.driver_model import ALONG_COS
from foretwin.sim_worker.metrics.ground import polygon_of
from foretwin.sim_worker.metrics.lane_lookup import LaneLookup
from foretwin.sim_worker.metrics.route_rules import direction_near
from foretwin.world_gen.extent import extent_of

_EVERY_M = 3.0
"""The path is looked up in the lanes at points so far apart."""


class LaneAreas:
    """The lanes and connections of a World as strips of their width, and its junctions' areas."""

    def __init__(self, world: World) -> None:
        self._world, self.extent = world, extent_of(world)
        self._ways: list[Lane | Connection] = [*world.lanes, *world.connections]
        self._strips = np.array([_strip(way) for way in self._ways], dtype=object)
        self._tree = shapely.STRtree(self._strips)
        self._index = {way.id: k for k, way in enumerate(self._ways)}
        areas = [polygon_of(j.area) for j in world.junctions if j.area is not None]
        self._junctions = shapely.union_all(areas)
        shapely.prepare(self._junctions)

    @functools.cached_property
    def lookup(self) -> LaneLookup:
        """The one lane or connection on which each of many points is."""
        return LaneLookup(self._world)

    def in_junction(self, points: Array) -> Flags:
        """Return whether points (K, 2) lie in a junction (K,)."""
        return np.asarray(shapely.contains_xy(self._junctions, points[:, 0], points[:, 1]))

    def in_several(self, corners: Array) -> Flags:
        """Return whether cars with `corners` (K, 4, 2) are in several lanes, and in none wholly."""
        point, way = self._containing(corners.reshape(-1, 2))
        car, ways = point // 4, max(len(self._ways), 1)
        pair, inside = np.unique(car * ways + way, return_counts=True)
        touched = np.bincount(pair // ways, minlength=len(corners))
        whole = np.bincount(pair[inside == 4] // ways, minlength=len(corners))
        return np.asarray((touched > 1) & (whole == 0))

    def route(self, path: FrenetPath) -> Flags:
        """Return which lanes and connections (W,) lead along a path, neighbours of theirs too."""
        points = path.pose_at(np.arange(0.0, path.length_m, _EVERY_M))
        point, way = self._containing(points.xy_m)
        on = np.zeros(len(self._ways), dtype=bool)
        for k, which in zip(point.tolist(), way.tolist(), strict=True):
            if not on[which]:
                x, y = direction_near(np.asarray(self._ways[which].centerline), points.xy_m[k])
                yaw = points.yaw_rad[k]
                on[which] = x * np.cos(yaw) + y * np.sin(yaw) >= ALONG_COS
        for which in np.flatnonzero(on).tolist():
            for side in ("left_id", "right_id"):
                beside = getattr(self._ways[which], side, None)
                while beside in self._index:
                    on[self._index[beside]] = True
                    beside = getattr(self._ways[self._index[beside]], side, None)
        return on

    def on_route(self, points: Array, route: Flags) -> Flags:
        """Return whether points (K, 2) lie in a lane or connection of the `route` (W,)."""
        point, way = self._containing(points)
        found: Flags = np.zeros(len(points), dtype=bool)
        found[point[route[way]]] = True
        return found

    def _containing(self, points: Array) -> tuple[Indices, Indices]:
        point, way = self._tree.query(shapely.points(points), predicate="within")
        return point, way


def _strip(way: Lane | Connection) -> shapely.Polygon:
    line = shapely.LineString(way.centerline)
    return line.buffer(way.width_m.value / 2.0, cap_style="flat")
