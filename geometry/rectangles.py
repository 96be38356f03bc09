"""Overlap, separation and clearance of oriented rectangles, vectorised over any number of pairs."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from foretwin.contracts.arrays import Array

_CORNERS = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]]) / 2.0


class Rectangles(NamedTuple):
    """Oriented rectangles: centres (…, 2), yaws (…), lengths and widths (…) or one for all."""

    centre_m: Array
    yaw_rad: Array
    length_m: Array | float
    width_m: Array | float


def corners(rectangles: Rectangles) -> Array:
    """Return (…, 4, 2) corners, counter-clockwise from the front left."""
    ahead = _CORNERS[:, 0] * np.asarray(rectangles.length_m)[..., None]
    aside = _CORNERS[:, 1] * np.asarray(rectangles.width_m)[..., None]
    cos = np.cos(rectangles.yaw_rad)[..., None]
    sin = np.sin(rectangles.yaw_rad)[..., None]
    x = cos * ahead - sin * aside
    y = sin * ahead + cos * aside
    return np.asarray(rectangles.centre_m[..., None, :] + np.stack([x, y], axis=-1))


def separations(a: Rectangles, b: Rectangles) -> Array:
    """Return (4, …) gaps in metres along the length and width of `a`, then of `b`.

    A pair is apart where any is positive, and then at least as far apart as the largest; where
    none is, its negative says how deep the two overlap along that axis. Separating axis theorem:
    Gottschalk, Lin, Manocha (1996), OBBTree, in two dimensions.
    """
    dx = b.centre_m[..., 0] - a.centre_m[..., 0]
    dy = b.centre_m[..., 1] - a.centre_m[..., 1]
    cos_a, sin_a = np.cos(a.yaw_rad), np.sin(a.yaw_rad)
    cos_b, sin_b = np.cos(b.yaw_rad), np.sin(b.yaw_rad)
    cos = np.abs(cos_a * cos_b + sin_a * sin_b)
    sin = np.abs(sin_a * cos_b - cos_a * sin_b)
    gaps = np.empty((4, *np.broadcast_shapes(dx.shape, np.shape(cos))))
    gaps[0] = np.abs(cos_a * dx + sin_a * dy) * 2 - (
        a.length_m + b.length_m * cos + b.width_m * sin
    )
    gaps[1] = np.abs(cos_a * dy - sin_a * dx) * 2 - (a.width_m + b.length_m * sin + b.width_m * cos)
    gaps[2] = np.abs(cos_b * dx + sin_b * dy) * 2 - (
        b.length_m + a.length_m * cos + a.width_m * sin
    )
    gaps[3] = np.abs(cos_b * dy - sin_b * dx) * 2 - (b.width_m + a.length_m * sin + a.width_m * cos)
    gaps /= 2.0
    return gaps


def overlapping(a: Rectangles, b: Rectangles) -> npt.NDArray[np.bool_]:
    """Return (…) bool: whether each pair overlaps or touches; NaN counts as an overlap."""
    return np.asarray(~(separations(a, b) > 0.0).any(axis=0))


def clearance(a: Rectangles, b: Rectangles) -> Array:
    """Return (…) distances in metres between the outlines of each pair, 0 where they overlap.

    The nearest points of two separate convex shapes include a corner of one of them.
    """
    distance = np.minimum(_corner_distance(a, b), _corner_distance(b, a))
    return np.where(overlapping(a, b), 0.0, distance)


def depth_within(points_m: Array, rectangles: Rectangles) -> Array:
    """Return (…, P) how deep points (…, P, 2) lie inside each rectangle (…), negative outside."""
    along, across = _beyond(points_m, rectangles)
    return np.asarray(-np.maximum(along, across))


def _corner_distance(of: Rectangles, to: Rectangles) -> Array:
    """Return the smallest distance from the corners of `of` to the rectangle `to`."""
    along, across = _beyond(corners(of), to)
    return np.asarray(np.hypot(np.maximum(along, 0.0), np.maximum(across, 0.0)).min(axis=-1))


def _beyond(points_m: Array, rectangles: Rectangles) -> tuple[Array, Array]:
    """Return how far (…, P) points lie beyond a rectangle's ends and sides."""
    relative = points_m - rectangles.centre_m[..., None, :]
    cos = np.cos(rectangles.yaw_rad)[..., None]
    sin = np.sin(rectangles.yaw_rad)[..., None]
    along = np.abs(cos * relative[..., 0] + sin * relative[..., 1])
    across = np.abs(cos * relative[..., 1] - sin * relative[..., 0])
    along -= np.asarray(rectangles.length_m)[..., None] / 2
    across -= np.asarray(rectangles.width_m)[..., None] / 2
    return along, across
