"""A path in arc length and lateral offset: vectorised projection and look-up for S vehicles.

The path is resampled at equal spacing and prolonged straight at both ends, so that look-ups are
index arithmetic and a vehicle never runs out of path.
"""

from __future__ import annotations

import functools
import math
import operator
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from foretwin.contracts.arrays import Array
from foretwin.geometry import compiled
from foretwin.geometry.path_nodes import (
    NodePlace,
    between,
    cut_corners,
    headings,
    node_table,
    prolonged,
    with_steps,
)
from foretwin.geometry.polyline import apart, arc_lengths

SPACING_M = 1.0
"""Between nodes. As it is one metre, an arc length less that of the first node is a place."""
_AFTER_M = 200.0
NEAR_M = 12.0
"""How far on either side of the last known place is searched."""
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

    `xy_m` (N, 2), `speed_limit_mps` (N,) or None, both of which stay as they are; `before_m` of
    straight are put in front. Raises ValueError for less than two distinct points or numbers that
    are not finite.
    """

    _is_eased = False

    def __init__(
        self, xy_m: Array, speed_limit_mps: Array | None = None, *, before_m: float = 20.0
    ) -> None:
        self._given = (xy_m, speed_limit_mps, before_m)
        points = np.asarray(xy_m, dtype=np.float64)
        if points.ndim != 2 or points.shape[1] != 2 or not np.isfinite(points).all():
            raise ValueError(f"a path needs finite points (N, 2), not shape {points.shape}")
        self._kept = apart(points, tolerance_m=1e-6)
        self._points = points if self._kept.all() else points[self._kept]
        if len(self._points) < 2:
            raise ValueError("a path needs at least two distinct points")
        self._arc = arc_lengths(self._points)
        self.length_m = float(self._arc[-1])

        before, after = int(before_m / SPACING_M), int((self.length_m + _AFTER_M) / SPACING_M)
        self.first_arc_m = -before * SPACING_M
        self._last = before + after

    @functools.cached_property
    def arc_m(self) -> Array:
        """(M,) arc length of the nodes."""
        return np.asarray(self.first_arc_m + SPACING_M * np.arange(self._last + 1))

    @functools.cached_property
    def speed_limit_mps(self) -> Array:
        """(M,) limits at the nodes, infinite where unknown."""
        _, given, _ = self._given
        if given is None:
            return np.full(self._last + 1, np.inf)
        limit = np.asarray(given, dtype=np.float64)[self._kept]
        limit = np.where(np.isfinite(limit) & (limit > 0.0), limit, np.inf)
        nearest = np.searchsorted(self._arc, self.arc_m, side="right") - 1
        return np.asarray(limit[np.clip(nearest, 0, len(limit) - 1)])

    # Of many paths nobody asks where they lead: what a table holds of the nodes is made when asked.

    @functools.cached_property
    def _xy(self) -> Array:
        """(2, M) x and y."""
        return np.stack([prolonged(self.arc_m, self._arc, column) for column in self._points.T])

    @functools.cached_property
    def _pieces(self) -> Array:
        """(8, M) x, y and the unit vector to the left, and the steps of these to the next node."""
        x_m, y_m = self._xy
        return node_table(x_m, y_m, self._heading)

    @functools.cached_property
    def _nodes(self) -> Array:
        """(4, M) x, y and the unit vector to the left."""
        return self._pieces[:4]

    @functools.cached_property
    def _heading(self) -> Array:
        """(M,) headings without jumps."""
        return headings(*self._xy)

    @functools.cached_property
    def _segments(self) -> Array:
        """(7, M - 1) start; what turns a way from it into a share of the length and an offset; arc
        length."""
        step = np.diff(self._nodes[:2])
        length = np.hypot(*step)
        cos, sin = step / length
        return np.stack(
            [*self._nodes[:2, :-1], cos / length, -sin, sin / length, cos, self.arc_m[:-1]]
        )

    def __reduce__(self) -> tuple[object, tuple[object, ...]]:
        """Travel to another process as what the path was made of."""
        xy_m, speed_limit_mps, before_m = self._given
        if self._is_eased:
            plain = FrenetPath(xy_m, speed_limit_mps, before_m=before_m)
            return operator.attrgetter("eased"), (plain,)
        return functools.partial(FrenetPath, before_m=before_m), (xy_m, speed_limit_mps)

    @property
    def node_poses(self) -> Array:
        """(M, 3) x, y and heading without jumps at the nodes."""
        return np.column_stack([*self._nodes[:2], self._heading])

    @functools.cached_property
    def curvature_pm(self) -> Array:
        """(M,) curvature at the nodes in 1/m, positive to the left, smoothed over 4 m."""
        k = _SMOOTH_NODES
        padded = np.pad(self._heading, k, mode="edge")
        return np.asarray((padded[2 * k :] - padded[: -2 * k]) / (2 * k * SPACING_M))

    def speed_profile(self, *, lateral_accel_mps2: float, decel_mps2: float) -> Array:
        """Return (M,) the speed at each node that curves ahead allow.

        √(a_lat / |κ|) at every node, lowered so that a deceleration of `decel_mps2` suffices to
        reach what lies ahead.
        """
        return np.asarray(self.with_curve_speeds(lateral_accel_mps2, decel_mps2)[len(self._nodes)])

    @property
    def eased(self) -> FrenetPath:
        """The path as a vehicle drives it that does not turn at once where the line has a corner:
        each node is moved to the mean of those a car's length around it, and keeps its arc length.
        """
        # None holds itself: what is done with then goes at once, however rarely garbage is sought.
        return self if self._is_eased else self._eased

    @functools.cached_property
    def _eased(self) -> FrenetPath:
        xy_m, speed_limit_mps, before_m = self._given
        path = FrenetPath(xy_m, speed_limit_mps, before_m=before_m)
        path._is_eased = True
        path.__dict__["_xy"] = np.stack([*map(cut_corners, self._xy)])
        return path

    def bounded_squares(
        self, *, lateral_accel_mps2: float, decel_mps2: float, accel_mps2: float
    ) -> Array:
        """Return (M,) the square of the speed at each node that accelerations allow, in (m/s)².

        a_lat / |κ|, where κ is how much the heading turns between two nodes, lowered so that
        `decel_mps2` reaches what lies ahead, and `accel_mps2` does from what lies behind.
        """
        key = (lateral_accel_mps2, decel_mps2, accel_mps2)
        if key not in self._bounds:
            turn = np.pad(np.abs(np.diff(self._heading)) / SPACING_M, 1, mode="edge")
            square = lateral_accel_mps2 / np.maximum(np.maximum(turn[1:], turn[:-1]), 1e-6)
            slope = 2.0 * decel_mps2 * self.arc_m
            square = np.minimum.accumulate((square + slope)[::-1])[::-1] - slope
            slope = 2.0 * accel_mps2 * self.arc_m
            self._bounds[key] = np.minimum.accumulate(square - slope) + slope
        return self._bounds[key]

    @functools.cached_property
    def _bounds(self) -> dict[tuple[float, float, float], Array]:
        return {}

    @functools.cached_property
    def _profiles(self) -> dict[tuple[float, float], Array]:
        return {}

    def with_curve_speeds(self, lateral_accel_mps2: float, decel_mps2: float) -> Array:
        """Return (10, M) x, y, the unit vector to the left and the speed that curves allow, at the
        nodes, then the steps of these to the next node."""
        key = (lateral_accel_mps2, decel_mps2)
        if key not in self._profiles:
            square = lateral_accel_mps2 / np.maximum(np.abs(self.curvature_pm), 1e-6)
            slope = 2.0 * decel_mps2 * self.arc_m
            ahead = np.minimum.accumulate((square + slope)[::-1])[::-1]
            speed = np.sqrt(np.minimum(ahead - slope, square))
            self._profiles[key] = with_steps(np.concatenate([self._nodes, speed[None]]))
        return self._profiles[key]

    def place(self, arc_m: Array) -> NodePlace:
        """Return where arc lengths of any shape lie among the nodes, clipped to the path."""
        place = arc_m - self.first_arc_m
        np.maximum(place, 0.0, out=place)
        np.minimum(place, self._last - 1e-9, out=place)
        node = place.astype(np.intp)
        place -= node
        return NodePlace(node, place)

    def at_nodes(self, values: Array, arc_m: Array) -> Array:
        """Interpolate `values` (M,), given at the nodes, at arc lengths of any shape."""
        node, share = self.place(arc_m)
        low = values[node]
        return np.asarray(low + share * (values[node + 1] - low))

    def point_of(self, place: NodePlace, offset_m: Array | float = 0.0) -> Array:
        """Return positions (2, …), x and y, at places and offsets to the left."""
        found = between(self._pieces, place)
        found[2:] *= offset_m
        found[:2] += found[2:]
        return found[:2]

    def point_at(self, arc_m: Array, offset_m: Array | float = 0.0) -> Array:
        """Return positions (…, 2) at arc lengths (…) and offsets to the left."""
        found = self.point_of(self.place(np.asarray(arc_m)), offset_m)
        # What moveaxis would do too, at several times the cost of all before it.
        return found.transpose(*range(1, found.ndim), 0)

    def pose_at(self, arc_m: Array, offset_m: Array | float = 0.0) -> PathPose:
        """Return positions and headings at arc lengths (…) and offsets to the left."""
        return PathPose(self.point_at(arc_m, offset_m), self.yaw_at(arc_m))

    def yaw_at(self, arc_m: Array) -> Array:
        """Return headings (…) at arc lengths (…), without jumps."""
        return self.at_nodes(self._heading, arc_m)

    def _nearest(self, xy_m: Array, end: int) -> npt.NDArray[np.intp]:
        """Return which of the nodes before `end` is nearest to each of the points."""
        if len(xy_m) > _MANY:
            # Slower to import than all else that the process of a hosted planner needs.
            from scipy.spatial import cKDTree

            return np.asarray(cKDTree(self._nodes[:2, :end].T).query(xy_m)[1], dtype=np.intp)
        x_m, y_m = self._nodes[:2, :end]
        dx, dy = x_m - xy_m[:, 0, None], y_m - xy_m[:, 1, None]
        dx *= dx
        dy *= dy
        dx += dy
        return np.asarray(dx.argmin(axis=1))

    def locate(
        self,
        xy_m: Array,
        *,
        near_arc_m: Array | None = None,
        within_m: float = NEAR_M,
        upto_arc_m: float = np.inf,
    ) -> FrenetPoint:
        """Project positions (S, 2) onto the path, as far as `upto_arc_m`.

        With `near_arc_m` (S,) only its surroundings are searched, `within_m` on either side, so
        that a path that crosses itself is followed rather than jumped along.
        """
        xy = np.asarray(xy_m, dtype=np.float64).T
        if near_arc_m is None:
            end = max(2, int(np.searchsorted(self.arc_m, upto_arc_m, side="right")))
            near, either = self.arc_m[self._nearest(xy_m, end)], 0
        else:
            near = np.asarray(near_arc_m, dtype=np.float64)
            either = min(math.ceil(within_m / SPACING_M), self._last // 2)
        found = np.empty((2, xy.shape[1]))
        compiled.locate(xy, near, self._nodes, self._segments, self.first_arc_m, either, found)
        return FrenetPoint(found[0], found[1])
