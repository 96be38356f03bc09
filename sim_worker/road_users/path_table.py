"""Many paths at once: poses of any number of road users, each at its place on a path of its own."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array, Indices
from foretwin.geometry.frenet_path import SPACING_M, FrenetPath
from foretwin.sim_worker.driver_model import BEND_DECEL_MPS2
from foretwin.sim_worker.road_users.compiled import interpolate
from foretwin.sim_worker.road_users.paces import square_bound


class OnPaths(NamedTuple):
    """Paths of any number of places (…): their first nodes in the table, where these are, and how
    many nodes on the last but one is."""

    begin: Indices
    first_arc_m: Array
    last: Indices


class PathPlace(NamedTuple):
    """Places (…) in a table: the node before, and the share of the way to the next."""

    node: Indices
    share: Array


class PathTable:
    """The nodes of P paths in one array, so that look-ups for all road users are one call.

    Beyond a path's ends, places go on straight. After the paths come `tracks` of poses (N, 3)
    without jumps of yaw, whose nodes are those of a clock instead of an arc length: the
    time gives the place on them.
    """

    def __init__(self, paths: Sequence[FrenetPath], tracks: Sequence[Array] = ()) -> None:
        if not paths:
            raise ValueError("a table needs at least one path")
        self.paths = tuple(paths)
        nodes = [*(path.node_poses for path in paths), *tracks]
        counts = np.array([len(poses) for poses in nodes])
        self._begin: Indices = np.concatenate([[0], np.cumsum(counts)[:-1]]).astype(np.intp)
        self._first_arc = np.array([path.arc_m[0] for path in paths] + [0.0] * len(tracks))
        self._last: Indices = np.maximum(counts - 2, 0)
        self._poses: Array = np.concatenate(nodes)
        """(M, 3) x, y and heading without jumps, of all nodes."""
        self._steps = np.diff(self._poses, axis=0, append=self._poses[-1:])

    def __len__(self) -> int:
        return len(self.paths)

    def on(self, path_of: Indices) -> OnPaths:
        """Return what places on these paths (…) have in common, to be looked up once."""
        return OnPaths(self._begin[path_of], self._first_arc[path_of], self._last[path_of])

    def place(self, on: OnPaths, arc_m: Array) -> PathPlace:
        """Return where arc lengths (…) are on their paths."""
        place = (arc_m - on.first_arc_m) / SPACING_M
        index = np.minimum(np.maximum(place, 0.0).astype(np.intp), on.last)
        return PathPlace(on.begin + index, place - index)

    def poses(self, place: PathPlace, lateral_m: Array | None = None) -> Array:
        """Return x, y, yaw (…, 3) at places on the paths, `lateral_m` (…) to the left of them."""
        found = np.empty((*place.node.shape, 3))
        rows = found.reshape(-1, 3)
        interpolate(place.node.ravel(), place.share.ravel(), self._poses, self._steps, rows)
        if lateral_m is not None:
            found[..., 0] -= np.sin(found[..., 2]) * lateral_m
            found[..., 1] += np.cos(found[..., 2]) * lateral_m
        return found

    def headings(self, place: PathPlace) -> Array:
        """Return the paths' headings (…), without jumps, at places."""
        return np.asarray(
            self._steps[:, 2].take(place.node) * place.share + self._poses[:, 2].take(place.node)
        )

    @functools.cached_property
    def _square_bounds(self) -> Array:
        bounds = [square_bound(path, decel_mps2=BEND_DECEL_MPS2) for path in self.paths]
        return np.concatenate([*bounds, np.full(len(self._poses) - sum(map(len, bounds)), np.inf)])

    def square_bound(self, place: PathPlace) -> Array:
        """Return (…) the square of the speed that bends let a law-abiding driver have at places."""
        low, high = self._square_bounds.take(place.node), self._square_bounds.take(place.node + 1)
        high -= low
        high *= np.minimum(np.maximum(place.share, 0.0), 1.0)
        high += low
        return np.asarray(high)

    def along(self, path: FrenetPath) -> PathProjection:
        """Project every node on another path, so that road users can be found on it at once."""
        place = path.locate(self._poses[:, :2])
        heading = path.yaw_at(place.arc_m)
        columns = [place.arc_m, place.offset_m, self._poses[:, 2] - heading]
        return PathProjection(np.column_stack(columns))


class PathProjection:
    """Where all places of a table lie on one other path, looked up instead of searched for."""

    def __init__(self, columns: Array) -> None:
        """`columns` (M, 3) are arc length, offset to the left and relative heading of all nodes."""
        # One array each: what is looked up then lies together.
        self._columns = [np.ascontiguousarray(column) for column in columns.T]
        self._steps = [np.diff(column, append=column[-1:]) for column in self._columns]

    def at(self, place: PathPlace) -> tuple[Array, Array, Array]:
        """Return arc length, offset to the left and relative heading (…) on the other path."""
        arc, offset, turned = (
            steps.take(place.node) * place.share + column.take(place.node)
            for steps, column in zip(self._steps, self._columns, strict=True)
        )
        return arc, offset, turned
