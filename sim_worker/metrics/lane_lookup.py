"""On which lanes of a World points are, many at once."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import wrap_angle
from foretwin.contracts.world import Connection, Lane, World
from foretwin.geometry.polyline import arc_lengths, points_at

_EVERY_M = 1.0
_NEAREST = 24
"""Looked at for each point: at the mouth of a junction some ten connections lie on one another."""
_RAD_AS_M = 3.0
"""Chosen: of two lanes that cross, the one that is driven as the point is headed is its own."""


class LaneLookup:
    """The middles of a World's lanes and connections as points, each with its heading."""

    def __init__(self, world: World) -> None:
        known: list[Lane | Connection] = [*world.lanes, *world.connections]
        ways = [way for way in known if len(way.centerline) > 1]
        self._ids = tuple(way.id for way in ways)
        parts = [_samples(way.centerline) for way in ways]
        counts = [len(part) for part in parts]
        samples = np.concatenate(parts) if parts else np.zeros((0, 3))
        self._tree, self._yaw = cKDTree(samples[:, :2]), samples[:, 2]
        self._way = np.repeat(np.arange(len(ways)), counts)
        half_m = np.array([way.width_m.value / 2.0 for way in ways])
        self._reach_m = np.repeat(half_m, counts) + _EVERY_M / 2.0

    def at(self, xy_m: Array, yaw_rad: Array) -> tuple[str, ...]:
        """Return the ids of the lanes on which points (K, 2) with headings (K,) are; "" beside all,
        and for points that are not finite."""
        found = [""] * len(xy_m)
        known = np.flatnonzero(np.isfinite(xy_m).all(axis=1) & np.isfinite(yaw_rad))
        if not len(known) or not len(self._yaw):
            return tuple(found)
        most = min(_NEAREST, len(self._yaw))
        away, near = self._tree.query(xy_m[known], k=np.arange(1, most + 1))
        turned = np.abs(wrap_angle(self._yaw[near] - yaw_rad[known, None]))
        on = away <= self._reach_m[near]
        best = np.where(on, away + _RAD_AS_M * turned, np.inf).argmin(axis=1)
        row = np.arange(len(known))
        way = np.where(on[row, best], self._way[near[row, best]], -1)
        for place, which in zip(known.tolist(), way.tolist(), strict=True):
            if which >= 0:
                found[place] = self._ids[which]
        return tuple(found)


def _samples(line: Array) -> Array:
    """Return (M, 3) x, y, heading along a polyline."""
    arc = arc_lengths(line)
    at = np.linspace(0.0, arc[-1], max(int(np.ceil(arc[-1] / _EVERY_M)), 1) + 1)
    points = points_at(line, at)
    steps = np.gradient(points, axis=0)
    return np.column_stack([points, np.arctan2(steps[:, 1], steps[:, 0])])
