"""Lines with corners as curves whose curvature has no jumps."""

from __future__ import annotations

import math

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.geometry.bends import rounded_through
from foretwin.geometry.polyline import length, points_at, unit
from foretwin.geometry.polyline_batch import Polylines

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
