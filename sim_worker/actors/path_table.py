"""Many paths at once: poses of any number of road users, each at its place on a path of its own."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from contracts.arrays import Array
from sim_worker.planners.path import SPACING_M, FrenetPath

Indices = npt.NDArray[np.intp]


class PathTable:
    """The nodes of P paths in one array, so that look-ups for all road users are one call.

    Places are a path's index and an arc length, both of any one shape; beyond a path's ends they
    stay at the end.
    """

    def __init__(self, paths: Sequence[FrenetPath]) -> None:
        if not paths:
            raise ValueError("a table needs at least one path")
        self.paths = tuple(paths)
        counts = np.array([len(path.arc_m) for path in paths])
        self._begin: Indices = np.concatenate([[0], np.cumsum(counts)[:-1]]).astype(np.intp)
        self._first_arc = np.array([path.arc_m[0] for path in paths])
        self._last = counts - 1.0
        self._poses: Array = np.concatenate([path.node_poses for path in paths])
        """(M, 3) x, y and heading without jumps, of all nodes."""
        self._steps = np.diff(self._poses, axis=0, append=self._poses[-1:])

    def __len__(self) -> int:
        return len(self.paths)

    def _locate(self, path_of: Indices, arc_m: Array) -> tuple[Indices, Array]:
        place = (arc_m - self._first_arc[path_of]) / SPACING_M
        place = np.minimum(np.maximum(place, 0.0), self._last[path_of] - 1e-9)
        index = place.astype(np.intp)
        return self._begin[path_of] + index, place - index

    def poses(self, path_of: Indices, arc_m: Array, lateral_m: Array | None = None) -> Array:
        """Return x, y, yaw (…, 3) at places on the paths, `lateral_m` (…) to the left of them."""
        index, share = self._locate(path_of, arc_m)
        found = self._steps[index]
        found *= share[..., None]
        found += self._poses[index]
        if lateral_m is not None:
            found[..., 0] -= np.sin(found[..., 2]) * lateral_m
            found[..., 1] += np.cos(found[..., 2]) * lateral_m
        return np.asarray(found)

    def along(self, path: FrenetPath) -> PathProjection:
        """Project every node on another path, so that road users can be found on it at once."""
        place = path.locate(self._poses[:, :2])
        heading = path.pose_at(place.arc_m).yaw_rad
        columns = [place.arc_m, place.offset_m, self._poses[:, 2] - heading]
        return PathProjection(self, np.column_stack(columns))

    def at_nodes(self, values: Array, path_of: Indices, arc_m: Array) -> Array:
        """Interpolate `values` (M, …), given at all nodes in order, at places on the paths."""
        index, share = self._locate(path_of, arc_m)
        low, high = values[index], values[np.minimum(index + 1, len(values) - 1)]
        return np.asarray(
            low + share.reshape(share.shape + (1,) * (values.ndim - 1)) * (high - low)
        )


class PathProjection:
    """Where all places of a table lie on one other path, looked up instead of searched for."""

    def __init__(self, table: PathTable, columns: Array) -> None:
        self._table = table
        self._columns = columns

    def at(self, path_of: Indices, arc_m: Array) -> tuple[Array, Array, Array]:
        """Return arc length, offset to the left and relative heading on the other path."""
        arc, offset, turned = np.moveaxis(
            self._table.at_nodes(self._columns, path_of, arc_m), -1, 0
        )
        return arc, offset, turned
