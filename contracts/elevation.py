"""How high roads and ground of a World lie, where an elevation model was given."""

from __future__ import annotations

import msgspec
import numpy as np

from foretwin.contracts.arrays import Array, Indices


class HeightProfile(msgspec.Struct, frozen=True, kw_only=True):
    """Heights along a road's reference line or a connection's centerline.

    At `along_m` (N,) the road lies `height_m` (N,) above the World's origin and rises by `grade`
    (N,), metres per metre; between, it is the cubic that these say (Hermite's).
    """

    id: str
    along_m: Array
    height_m: Array
    grade: Array

    def height_at(self, along_m: Array) -> Array:
        """Return heights (M,) at arc lengths (M,), held at the ends."""
        piece, t, step = self._places(along_m)
        a, b, c, d = self.cubics()[piece].T
        x = t * step
        return np.asarray(a + x * (b + x * (c + x * d)))

    def grade_at(self, along_m: Array) -> Array:
        """Return grades (M,), rise over run, at arc lengths (M,), held at the ends."""
        piece, t, step = self._places(along_m)
        _, b, c, d = self.cubics()[piece].T
        x = t * step
        return np.asarray(b + x * (2.0 * c + x * 3.0 * d))

    def cubics(self) -> Array:
        """Return (N - 1, 4) a, b, c, d of a + b s + c s² + d s³ from each place on."""
        step = np.maximum(np.diff(self.along_m), 1e-9)
        a, end = self.height_m[:-1], self.height_m[1:]
        b, out = self.grade[:-1], self.grade[1:]
        mean = (end - a) / step
        return np.column_stack(
            [a, b, (3.0 * mean - 2.0 * b - out) / step, (b + out - 2.0 * mean) / step**2]
        )

    def _places(self, along_m: Array) -> tuple[Indices, Array, Array]:
        at = np.asarray(along_m, dtype=np.float64)
        piece = np.clip(
            np.searchsorted(self.along_m, at, side="right") - 1, 0, len(self.along_m) - 2
        )
        step = np.maximum(np.diff(self.along_m), 1e-9)[piece]
        return piece, np.clip((at - self.along_m[piece]) / step, 0.0, 1.0), step


class Elevation(msgspec.Struct, frozen=True, kw_only=True):
    """Heights of a World, in metres above its origin; that lies `base_m` above the sea.

    `grade_std` is how far the grade of a road is off where it does not run over a bridge or
    through a tunnel. `ground_m` (rows, columns) is the open ground, its first sample at the
    south-west corner `ground_from_m` (x, y), `ground_step_m` from one to the next: eastwards along
    a row, northwards from row to row.
    """

    source: str
    base_m: float
    grade_std: float
    roads: tuple[HeightProfile, ...]
    connections: tuple[HeightProfile, ...]
    ground_from_m: tuple[float, float]
    ground_step_m: float
    ground_m: Array

    def ground_at(self, xy_m: Array) -> Array:
        """Return heights (N,) of the open ground at places (N, 2), bilinear, held at its edge."""
        rows, columns = self.ground_m.shape
        at = (np.asarray(xy_m, dtype=np.float64) - self.ground_from_m) / self.ground_step_m
        x, y = np.clip(at[:, 0], 0.0, columns - 1.0), np.clip(at[:, 1], 0.0, rows - 1.0)
        left = np.minimum(x.astype(np.intp), columns - 2)
        below = np.minimum(y.astype(np.intp), rows - 2)
        u, v = x - left, y - below
        near, far = self.ground_m[below], self.ground_m[below + 1]
        row = np.arange(len(x))
        low = near[row, left] * (1.0 - u) + near[row, left + 1] * u
        high = far[row, left] * (1.0 - u) + far[row, left + 1] * u
        return np.asarray(low * (1.0 - v) + high * v)


class RoadSlopes(msgspec.Struct, frozen=True, kw_only=True):
    """How roads climb at places (N, 2): the unit `direction` (N, 2) there and the `grade` (N,) that
    way, rise over run; `grade_std` is how far one is off."""

    xy_m: Array
    direction: Array
    grade: Array
    grade_std: float
