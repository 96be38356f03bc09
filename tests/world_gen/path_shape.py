"""How smooth paths are: bends where they meet, the radius of their tightest arc; smooth ones."""

from __future__ import annotations

import math

import numpy as np

from foretwin.geometry.bends import rounded_through
from foretwin.geometry.polyline_batch import Polylines
from foretwin.geometry.turn_curves import turn_curves


def bend_rad(u: np.ndarray, v: np.ndarray) -> float:
    """Return the angle between two directions (2,)."""
    return abs(math.atan2(u[0] * v[1] - u[1] * v[0], float(u @ v)))


def end_bends_rad(start: np.ndarray, path: np.ndarray, end: np.ndarray) -> tuple[float, float]:
    """Return the angles between a path and the lanes (N, 2) that it leaves and reaches."""
    return (
        bend_rad(start[-1] - start[-2], path[1] - path[0]),
        bend_rad(path[-1] - path[-2], end[1] - end[0]),
    )


def tightest_radius_m(path: np.ndarray) -> float:
    """Return the least radius of the circles through three points in a row, inf for a line."""
    a, b, c = path[:-2], path[1:-1], path[2:]
    if not len(a):
        return math.inf
    ab, bc, ac = (np.hypot(*(q - p).T) for p, q in ((a, b), (b, c), (a, c)))
    twice = np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    bent = 2.0 * twice / np.maximum(ab * bc * ac, 1e-12)
    return float(1.0 / max(float(bent.max()), 1e-9))


def turn_curve(
    start: np.ndarray, heading: np.ndarray, end: np.ndarray, end_heading: np.ndarray
) -> np.ndarray:
    """Return the path (N, 2) of one turn; all are (2,)."""
    (path,) = turn_curves(start[None], heading[None], end[None], end_heading[None]).lines.split()
    return path


def rounded(xy_m: np.ndarray) -> np.ndarray:
    """Return a line (N, 2) with its corners rounded."""
    nothing = np.full((1, 2), np.nan)
    (path,) = rounded_through(Polylines.of([xy_m]), np.array([0.0]), nothing, nothing).lines.split()
    return path
