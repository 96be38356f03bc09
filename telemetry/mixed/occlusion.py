"""How much of each body a sensor sees: its field of view, its range, and what stands before it.

All is seen from above: a body hides whatever lies behind it, however low it is. What is told of a
body is exact for bodies that do not overlap: of two convex ones that are apart, one is in front of
the other along every ray that meets both.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array, Flags
from foretwin.contracts.frames import wrap_angle
from foretwin.geometry.rectangles import Rectangles, corners, depth_within

_TURNS = (-math.tau, 0.0, math.tau)


class Viewpoint(NamedTuple):
    """A sensor's place and the middle of its field of view, in the plane of the bodies."""

    x_m: float
    y_m: float
    yaw_rad: float
    field_of_view_rad: float
    """2π or more: all round."""
    range_m: float
    """To the nearest point of what it sees."""


def seen_shares(view: Viewpoint, bodies: Rectangles, hides: Flags) -> Array:
    """Return (N,) which share of each body's width, as it appears from the sensor, is seen.

    `bodies` are (N,), and `hides` (N, N) says whether the second may hide the first. A body around
    the sensor is seen whole and hides nothing.
    """
    eye = np.array([view.x_m, view.y_m])
    moved = bodies._replace(centre_m=bodies.centre_m - eye)
    depth_m = depth_within(np.zeros((1, 2)), moved)[..., 0]
    around = depth_m >= 0.0
    offsets = corners(moved)
    middle = np.arctan2(moved.centre_m[:, 1], moved.centre_m[:, 0])
    turned = wrap_angle(np.arctan2(offsets[..., 1], offsets[..., 0]) - middle[:, None])
    low, high = turned.min(axis=1), turned.max(axis=1)
    shares = np.where(around, 1.0, 0.0)
    hides = hides & ~around & ~np.eye(len(middle), dtype=bool)
    for i in np.flatnonzero(~around & (_nearest_m(moved) <= view.range_m)):
        covered = [*_unseen(view, float(middle[i]))]
        for j in np.flatnonzero(hides[i]):
            towards = float(wrap_angle(middle[j] - middle[i]))
            for turn in _TURNS:
                start = max(towards + turn + low[j], low[i])
                end = min(towards + turn + high[j], high[i])
                if start < end and _is_nearer(
                    moved, int(j), int(i), middle[i] + 0.5 * (start + end)
                ):
                    covered.append((start, end))
        free = (high[i] - low[i]) - _covered_rad(covered, low[i], high[i])
        shares[i] = max(0.0, free / (high[i] - low[i]))
    return shares


def _nearest_m(bodies: Rectangles) -> Array:
    """Return (N,) the distances from the origin to the bodies' nearest points."""
    cos, sin = np.cos(bodies.yaw_rad), np.sin(bodies.yaw_rad)
    x, y = bodies.centre_m[:, 0], bodies.centre_m[:, 1]
    along = np.maximum(np.abs(cos * x + sin * y) - np.asarray(bodies.length_m) / 2.0, 0.0)
    across = np.maximum(np.abs(cos * y - sin * x) - np.asarray(bodies.width_m) / 2.0, 0.0)
    return np.asarray(np.hypot(along, across))


def _unseen(view: Viewpoint, middle_rad: float) -> list[tuple[float, float]]:
    """Return what lies outside the field of view, as angles around a direction."""
    half = math.pi - 0.5 * view.field_of_view_rad
    if half <= 0.0:
        return []
    behind = float(wrap_angle(view.yaw_rad + math.pi - middle_rad))
    return [(behind + turn - half, behind + turn + half) for turn in _TURNS]


def _covered_rad(parts: list[tuple[float, float]], low: float, high: float) -> float:
    """Return how much of an interval intervals cover together."""
    total, reached = 0.0, low
    for start, end in sorted(parts):
        start, end = max(start, reached), min(end, high)
        if end > start:
            total += end - start
            reached = end
    return total


def _is_nearer(bodies: Rectangles, j: int, i: int, angle_rad: float) -> bool:
    """Whether a ray from the origin meets body `j` before body `i`."""
    return _met_at_m(bodies, j, angle_rad) < _met_at_m(bodies, i, angle_rad)


def _met_at_m(bodies: Rectangles, index: int, angle_rad: float) -> float:
    """Return how far a ray from the origin goes until it meets a body (slabs: Kay, Kajiya 1986)."""
    x, y = bodies.centre_m[index]
    yaw = float(bodies.yaw_rad[index])
    cos, sin = math.cos(yaw), math.sin(yaw)
    ahead, aside = math.cos(angle_rad - yaw), math.sin(angle_rad - yaw)
    entered = 0.0
    for place, way, half in (
        (cos * x + sin * y, ahead, 0.5 * np.asarray(bodies.length_m)[index]),
        (cos * y - sin * x, aside, 0.5 * np.asarray(bodies.width_m)[index]),
    ):
        if abs(way) > 1e-12:
            entered = max(entered, (place - math.copysign(half, way)) / way)
    return entered
