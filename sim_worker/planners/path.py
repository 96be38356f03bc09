"""A path in arc length and lateral offset: vectorised projection and look-up for S vehicles.

The path is resampled at equal spacing and prolonged straight at both ends, so that look-ups are
index arithmetic and a vehicle never runs out of path.
"""

from __future__ import annotations

import functools
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from contracts.arrays import Array

SPACING_M = 1.0
_AFTER_M = 200.0
_WINDOW = 12
"""Nodes searched on either side of the last known place."""
_MANY = 32
"""Points, from which on a tree of the nodes is searched faster than all of them."""
_SMOOTH_NODES = 2
"""Curvature is the heading change over this many nodes on either side."""


class FrenetPoint(NamedTuple):
    """Places along a path: arc length (S,) and lateral offset (S,), positive to the left."""

    arc_m: Array
    offset_m: Array


class PathPose(NamedTuple):
    """Points of a path: positions (S, 2) and headings (S,)."""

    xy_m: Array
    yaw_rad: Array


class FrenetPath:
    """A polyline with arc length 0 at its first given point.

    `xy_m` (N, 2), `speed_limit_mps` (N,) or None; `before_m` of straight are put in front. Raises
    ValueError for less than two distinct points or numbers that are not finite.
    """

    def __init__(
        self, xy_m: Array, speed_limit_mps: Array | None = None, *, before_m: float = 20.0
    ) -> None:
        self._given = (xy_m, speed_limit_mps, before_m)
        points = np.asarray(xy_m, dtype=np.float64)
        if points.ndim != 2 or points.shape[1] != 2 or not np.isfinite(points).all():
            raise ValueError(f"a path needs finite points (N, 2), not shape {points.shape}")
        steps = np.hypot(*np.diff(points, axis=0).T)
        keep = np.concatenate([[True], steps > 1e-6])
        points = points[keep]
        if len(points) < 2:
            raise ValueError("a path needs at least two distinct points")
        arc = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
        self.length_m = float(arc[-1])

        before, after = int(before_m / SPACING_M), int((self.length_m + _AFTER_M) / SPACING_M)
        self._first_arc = -before * SPACING_M
        self.arc_m: Array = np.arange(-before, after + 1, dtype=np.float64) * SPACING_M
        """(M,) arc length of the nodes."""
        self._x = _prolonged(self.arc_m, arc, points[:, 0])
        self._y = _prolonged(self.arc_m, arc, points[:, 1])
        heading = np.unwrap(np.arctan2(np.gradient(self._y), np.gradient(self._x)))
        self._heading = heading
        self._cos, self._sin = np.cos(heading), np.sin(heading)
        self._nodes = np.stack([self._x, self._y, self._cos, self._sin], axis=-1)
        self._steps = np.diff(self._nodes, axis=0)
        self._last = len(self.arc_m) - 1
        length = np.hypot(self._steps[:, 0], self._steps[:, 1])
        self._segments = np.column_stack(
            [self._x[:-1], self._y[:-1], self._steps[:, :2] / length[:, None], 1.0 / length]
        )
        """(M - 1, 5) start, direction, one over the length."""
        if speed_limit_mps is None:
            self.speed_limit_mps = np.full(len(self.arc_m), np.inf)
        else:
            limit = np.asarray(speed_limit_mps, dtype=np.float64)[keep]
            limit = np.where(np.isfinite(limit) & (limit > 0.0), limit, np.inf)
            nearest = np.clip(np.searchsorted(arc, self.arc_m, side="right") - 1, 0, len(arc) - 1)
            self.speed_limit_mps = limit[nearest]
        """(M,) limits at the nodes, infinite where unknown."""

    def __reduce__(self) -> tuple[object, tuple[object, ...]]:
        """Travel to another process as what the path was made of."""
        return _path_of, self._given

    @property
    def node_poses(self) -> Array:
        """(M, 3) x, y and heading without jumps at the nodes."""
        return np.column_stack([self._x, self._y, self._heading])

    @functools.cached_property
    def _windows(self) -> tuple[Array, Array]:
        """(M - 2 W, 2 W + 1) x and y of the nodes around each, for the search near a place."""
        views = np.lib.stride_tricks.sliding_window_view
        # Copies, whose rows are taken together faster than those of views.
        x, y = (views(values, 2 * _WINDOW + 1).copy() for values in (self._x, self._y))
        return x, y

    @functools.cached_property
    def curvature_pm(self) -> Array:
        """(M,) curvature at the nodes in 1/m, positive to the left, smoothed over 4 m."""
        k = _SMOOTH_NODES
        padded = np.pad(self._heading, k, mode="edge")
        return np.asarray((padded[2 * k :] - padded[: -2 * k]) / (2 * k * SPACING_M))

    @functools.cached_property
    def _profiles(self) -> dict[tuple[float, float], Array]:
        return {}

    def speed_profile(self, *, lateral_accel_mps2: float, decel_mps2: float) -> Array:
        """Return (M,) the speed at each node that curves ahead allow.

        √(a_lat / |κ|) at every node, lowered so that a deceleration of `decel_mps2` suffices to
        reach what lies ahead.
        """
        key = (lateral_accel_mps2, decel_mps2)
        if key not in self._profiles:
            square = lateral_accel_mps2 / np.maximum(np.abs(self.curvature_pm), 1e-6)
            slope = 2.0 * decel_mps2 * self.arc_m
            ahead = np.minimum.accumulate((square + slope)[::-1])[::-1]
            self._profiles[key] = np.sqrt(np.minimum(ahead - slope, square))
        return self._profiles[key]

    def _place(self, arc_m: Array) -> tuple[npt.NDArray[np.intp], Array]:
        """Return node index and fraction towards the next, clipped to the path."""
        place = (arc_m - self._first_arc) / SPACING_M
        place = np.minimum(np.maximum(place, 0.0), self._last - 1e-9)
        index = place.astype(np.intp)
        return index, place - index

    def at_nodes(self, values: Array, arc_m: Array) -> Array:
        """Interpolate `values` (M,), given at the nodes, at arc lengths of any shape."""
        index, share = self._place(arc_m)
        low = values[index]
        return np.asarray(low + share * (values[index + 1] - low))

    def point_at(self, arc_m: Array, offset_m: Array | float = 0.0) -> Array:
        """Return positions (…, 2) at arc lengths (…) and offsets to the left."""
        index, share = self._place(arc_m)
        rows = self._steps.take(index, axis=0)
        rows *= share[..., None]
        rows += self._nodes.take(index, axis=0)
        point = rows[..., :2]
        point[..., 0] -= rows[..., 3] * offset_m
        point[..., 1] += rows[..., 2] * offset_m
        return np.asarray(point)

    def pose_at(self, arc_m: Array, offset_m: Array | float = 0.0) -> PathPose:
        """Return positions and headings at arc lengths (…) and offsets to the left."""
        return PathPose(self.point_at(arc_m, offset_m), self.at_nodes(self._heading, arc_m))

    def _nearest(self, xy_m: Array, end: int) -> npt.NDArray[np.intp]:
        """Return which of the nodes before `end` is nearest to each of the points."""
        if len(xy_m) > _MANY:
            # Slower to import than all else that the process of a hosted planner needs.
            from scipy.spatial import cKDTree

            return np.asarray(cKDTree(self._nodes[:end, :2]).query(xy_m)[1], dtype=np.intp)
        dx, dy = self._x[:end] - xy_m[:, 0, None], self._y[:end] - xy_m[:, 1, None]
        dx *= dx
        dy *= dy
        dx += dy
        return np.asarray(dx.argmin(axis=1))

    def locate(
        self, xy_m: Array, *, near_arc_m: Array | None = None, upto_arc_m: float = np.inf
    ) -> FrenetPoint:
        """Project positions (S, 2) onto the path, as far as `upto_arc_m`.

        With `near_arc_m` (S,) only its surroundings (±12 m) are searched, so that a path that
        crosses itself is followed rather than jumped along.
        """
        x, y = xy_m[:, 0], xy_m[:, 1]
        if near_arc_m is None:
            end = max(2, int(np.searchsorted(self.arc_m, upto_arc_m, side="right")))
            index = self._nearest(xy_m, end)
        else:
            centre = (near_arc_m - (self._first_arc + _WINDOW * SPACING_M)) / SPACING_M
            centre = np.minimum(np.maximum(centre, 0.0), self._last - 2 * _WINDOW)
            start = centre.astype(np.intp)
            dx, dy = (window.take(start, axis=0) for window in self._windows)
            dx -= x[:, None]
            dy -= y[:, None]
            dx *= dx
            dy *= dy
            dx += dy
            index = start + dx.argmin(axis=1)
        # The node's own tangent decides between the segment before and the one after.
        x0, y0, cos, sin = self._nodes.take(index, axis=0).T
        index = index - ((x - x0) * cos + (y - y0) * sin < 0.0)
        index = np.minimum(np.maximum(index, 0), self._last - 1)
        x0, y0, cos, sin, per_length = self._segments.take(index, axis=0).T
        x, y = x - x0, y - y0
        share = (x * cos + y * sin) * per_length
        share = np.minimum(np.maximum(share, 0.0), 1.0)
        arc = (index + share) * SPACING_M + self._first_arc
        return FrenetPoint(arc, cos * y - sin * x)


def _path_of(xy_m: Array, speed_limit_mps: Array | None, before_m: float) -> FrenetPath:
    return FrenetPath(xy_m, speed_limit_mps, before_m=before_m)


def _prolonged(at: Array, arc: Array, values: Array) -> Array:
    """Interpolate `values` over `arc`, going on straight beyond both ends."""
    inside = np.interp(at, arc, values)
    first = (values[1] - values[0]) / (arc[1] - arc[0])
    last = (values[-1] - values[-2]) / (arc[-1] - arc[-2])
    inside = np.where(at < arc[0], values[0] + (at - arc[0]) * first, inside)
    return np.asarray(np.where(at > arc[-1], values[-1] + (at - arc[-1]) * last, inside))
