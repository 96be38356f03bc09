"""How high the lanes of a World lie: its roads' profiles, asked for at places."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Any, NamedTuple

import msgspec
import numpy as np
import shapely

from foretwin.contracts.arrays import Array
from foretwin.contracts.elevation import Elevation, HeightProfile
from foretwin.contracts.world import Connection, Lane, World
from foretwin.geometry.polyline import stretches

_BESIDE_M, _SAMPLES_M = 8.0, 4.0
"""Beyond this from a lane's middle the ground begins to be its own, and is at twice of it."""


class LaneSlope(NamedTuple):
    """Points (N, 2) along a lane, the unit direction in which it is driven there, and its grade."""

    xy_m: Array
    direction: Array
    grade: Array


class WorldHeights:
    """Heights above the origin of a World that has an elevation; for others see `heights_of`."""

    def __init__(self, world: World, elevation: Elevation) -> None:
        self.elevation = elevation
        self._parts: list[Lane | Connection] = [*world.lanes, *world.connections]
        self._lines = {road.id: road.reference_line for road in world.roads}
        self._roads: Mapping[str, HeightProfile] = {p.id: p for p in elevation.roads}
        self._connections: Mapping[str, HeightProfile] = {p.id: p for p in elevation.connections}

    def road(self, road_id: str) -> HeightProfile | None:
        """Return a road's profile along its reference line; None for a track of trams alone."""
        return self._roads.get(road_id)

    def connection(self, connection_id: str) -> HeightProfile | None:
        """Return a connection's profile along its centerline."""
        return self._connections.get(connection_id)

    def along(self, part: Lane | Connection, xy_m: Array) -> Array:
        """Return heights (N,) of places (N, 2) on or beside a lane or connection."""
        profile, line = self._of(part)
        if profile is None:
            return self.elevation.ground_at(xy_m)
        return profile.height_at(_along(line, xy_m))

    def surface_at(self, xy_m: Array) -> Array:
        """Return how high the ground lies at places (N, 2): as the road there, else as open ground.

        Bridges and tunnels are no ground.
        """
        open_m = self.elevation.ground_at(xy_m)
        tree, places, direction, height, grade = self._on_ground
        if tree is None:
            return open_m
        far, near = tree.query(xy_m)
        ahead = ((xy_m - places[near]) * direction[near]).sum(axis=1)
        road_m = height[near] + grade[near] * np.clip(ahead, -_BESIDE_M, _BESIDE_M)
        share = np.clip((far - _BESIDE_M) / _BESIDE_M, 0.0, 1.0)
        return np.asarray((1.0 - share) * road_m + share * open_m)

    @cached_property
    def _on_ground(self) -> tuple[Any, Array, Array, Array, Array]:
        """Return a spatial tree over places of lanes on the ground, and what is known there."""
        found, heights = [], []
        for part in self._parts:
            if not part.layer:
                slope = self.slope(part, spacing_m=_SAMPLES_M)
                found.append(slope)
                heights.append(self.along(part, slope.xy_m))
        if not found:
            nothing = np.zeros((0, 2))
            return None, nothing, nothing, np.zeros(0), np.zeros(0)
        # Imported here: most Worlds are flat.
        from scipy.spatial import cKDTree

        places = np.concatenate([one.xy_m for one in found])
        return (
            cKDTree(places),
            places,
            np.concatenate([one.direction for one in found]),
            np.concatenate(heights),
            np.concatenate([one.grade for one in found]),
        )

    def slope(self, part: Lane | Connection, *, spacing_m: float) -> LaneSlope:
        """Return how a lane or connection climbs, at places at most `spacing_m` apart."""
        at, points, direction = stretches(part.centerline, spacing_m=spacing_m)
        profile, line = self._of(part)
        if profile is None:
            return LaneSlope(points, direction, np.zeros(len(at)))
        grade = profile.grade_at(_along(line, points))
        back = isinstance(part, Lane) and part.reverse
        return LaneSlope(points, direction, -grade if back else grade)

    def _of(self, part: Lane | Connection) -> tuple[HeightProfile | None, Array]:
        if isinstance(part, Connection):
            return self._connections.get(part.id), part.centerline
        return self._roads.get(part.road_id), self._lines.get(part.road_id, part.centerline)


def standing(
    hills: WorldHeights | None, outline: Array, low_m: float, high_m: float
) -> tuple[float, float]:
    """Return underside and top of what stands on its outline (N, 2), as high as it is on a plane.

    On a slope it stands on its lowest corner, or above the highest where it leaves room below, and
    reaches as high over the highest. On flat ground (None) nothing changes.
    """
    if hills is None:
        return low_m, high_m
    ground = hills.surface_at(outline)
    most = float(ground.max())
    return low_m + (most if low_m else float(ground.min())), high_m + most


def heights_of(world: World) -> WorldHeights | None:
    """Return the heights of a World, None where it is flat."""
    if isinstance(world.elevation, msgspec.UnsetType):
        return None
    return WorldHeights(world, world.elevation)


def _along(line: Array, xy_m: Array) -> Array:
    """Return arc lengths (N,) of the places of a line nearest to (N, 2) points."""
    return np.asarray(shapely.line_locate_point(shapely.LineString(line), shapely.points(xy_m)))
