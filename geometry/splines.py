"""Lines with corners, and points of rings, as curves whose curvature has no jumps."""

from __future__ import annotations

import math

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.geometry.bends import rounded_through
from foretwin.geometry.polyline import left_of, length, points_at, turn_rad, unit
from foretwin.geometry.polyline_batch import Polylines

_WIDEST_HALF_RAD = math.radians(45.0)
_SPACING_M, _PER_SPACING = 3.0, 4
"""Of control points, and how many points stand for each stretch between them."""


def through_corners(line: Array, *, radius_m: float) -> Array:
    """Return a line (N, 2) as a cubic B-spline, whose curvature has no jumps and no bend at an end.

    Its control points lie evenly on the line with its corners rounded to `radius_m` where there
    is room. The ends stay to the last bit, other points lie on the millimetre grid.
    """
    nothing = np.full((1, 2), np.nan)
    wide = np.array([radius_m])
    (rounded,) = rounded_through(Polylines.of([line]), wide, nothing, nothing).lines.split()
    total_m = length(rounded)
    spans = max(math.ceil(total_m / _SPACING_M), 3)
    inner = points_at(rounded, np.linspace(0.0, total_m, spans + 1))
    step_m = total_m / spans
    inner[1] = line[0] + step_m * unit(line[1] - line[0])
    inner[-2] = line[-1] - step_m * unit(line[-1] - line[-2])
    # Mirrored beyond the ends: the spline passes through these along the lanes, straight.
    control = np.concatenate([[2.0 * line[0] - inner[1]], inner, [2.0 * line[-1] - inner[-2]]])
    at = (np.arange(_PER_SPACING) / _PER_SPACING)[:, None, None]
    a, b, c, d = (control[k : k + spans] for k in range(4))
    points = (1.0 - at) ** 3 * a + (3.0 * at**3 - 6.0 * at**2 + 4.0) * b
    points = points + (1.0 + 3.0 * at + 3.0 * at**2 - 3.0 * at**3) * c + at**3 * d
    path = np.round((points / 6.0).transpose(1, 0, 2).reshape(-1, 2), 3)
    return np.concatenate([line[:1], path[1:], line[-1:]])


def arcs_through(line: Array, before: Array, after: Array, *, step_rad: float) -> list[Array]:
    """Return for each chord of a line (N, 2) points of a curve through its points, ends included.

    Between two points the circle through them and the one before passes into the circle through
    them and the one after, so that points of a circle give that circle, and direction and
    curvature have no jumps elsewhere (Yuksel 2020, A Class of C2 Interpolating Splines, section
    3.2). `before` and `after` (2,) are the next points beyond the ends; NaN, and a turn of more
    than a quarter of a circle within a chord: straight there. No two steps of an arc turn farther
    than `step_rad`.
    """
    points = np.concatenate([before[None], line, after[None]])
    first, begin, end, last = (points[k : k + len(line) - 1] for k in range(4))
    # A circle's chord is seen from each of its points under half the angle of the arc over it.
    halves = np.stack([turn_rad(begin - first, end - first), turn_rad(begin - last, end - last)])
    halves = np.where(np.abs(halves) < _WIDEST_HALF_RAD, halves, 0.0)
    pieces = np.ceil(2.0 * np.abs(halves).max(axis=0) / step_rad).astype(int)
    return [
        _blended(begin[k], end[k], halves[:, k], max(count, 1))
        for k, count in enumerate(pieces.tolist())
    ]


def _blended(begin: Array, end: Array, halves: Array, pieces: int) -> Array:
    """Return (pieces + 1, 2) points between two arcs over one chord, which turn `2 halves`."""
    share = np.linspace(0.0, 1.0, pieces + 1)
    chord = end - begin
    arcs = []
    for half in halves.tolist():
        reach = np.sin(half * share) / math.sin(half) if half else share
        turned = half * (share - 1.0)
        ahead = np.cos(turned)[:, None] * chord + np.sin(turned)[:, None] * left_of(chord)
        arcs.append(begin + reach[:, None] * ahead)
    to_second = np.sin(0.5 * math.pi * share)[:, None] ** 2
    points: Array = arcs[0] * (1.0 - to_second) + arcs[1] * to_second
    points[[0, -1]] = begin, end
    return points
