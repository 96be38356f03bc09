"""Overlap and clearance of oriented rectangles, vectorised over any number of pairs."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from contracts.arrays import Array

_CORNERS = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]]) / 2.0


class Rectangles(NamedTuple):
    """Oriented rectangles: centres (…, 2), yaws (…), one length and width for all."""

    centre_m: Array
    yaw_rad: Array
    length_m: float
    width_m: float


def corners(rectangles: Rectangles) -> Array:
    """Return (…, 4, 2) corners, counter-clockwise from the front left."""
    offsets = _CORNERS * (rectangles.length_m, rectangles.width_m)
    cos = np.cos(rectangles.yaw_rad)[..., None]
    sin = np.sin(rectangles.yaw_rad)[..., None]
    x = cos * offsets[:, 0] - sin * offsets[:, 1]
    y = sin * offsets[:, 0] + cos * offsets[:, 1]
    return np.asarray(rectangles.centre_m[..., None, :] + np.stack([x, y], axis=-1))


def overlapping(a: Rectangles, b: Rectangles) -> npt.NDArray[np.bool_]:
    """Return (…) bool: whether each pair overlaps, by the separating axis theorem.

    Gottschalk, Lin, Manocha (1996), OBBTree, in two dimensions: two axes of either rectangle.
    """
    between = b.centre_m - a.centre_m
    cos_a, sin_a = np.cos(a.yaw_rad), np.sin(a.yaw_rad)
    cos_b, sin_b = np.cos(b.yaw_rad), np.sin(b.yaw_rad)
    cos = np.abs(cos_a * cos_b + sin_a * sin_b)
    sin = np.abs(sin_a * cos_b - cos_a * sin_b)
    dx, dy = between[..., 0], between[..., 1]
    apart = (
        (np.abs(cos_a * dx + sin_a * dy) * 2 > a.length_m + b.length_m * cos + b.width_m * sin)
        | (np.abs(cos_a * dy - sin_a * dx) * 2 > a.width_m + b.length_m * sin + b.width_m * cos)
        | (np.abs(cos_b * dx + sin_b * dy) * 2 > b.length_m + a.length_m * cos + a.width_m * sin)
        | (np.abs(cos_b * dy - sin_b * dx) * 2 > b.width_m + a.length_m * sin + a.width_m * cos)
    )
    return np.asarray(~apart)


def clearance(a: Rectangles, b: Rectangles) -> Array:
    """Return (…) distances in metres between the outlines of each pair, 0 where they overlap.

    The nearest points of two separate convex shapes include a corner of one of them.
    """
    distance = np.minimum(_corner_distance(a, b), _corner_distance(b, a))
    return np.where(overlapping(a, b), 0.0, distance)


def _corner_distance(of: Rectangles, to: Rectangles) -> Array:
    """Return the smallest distance from the corners of `of` to the rectangle `to`."""
    relative = corners(of) - to.centre_m[..., None, :]
    cos = np.cos(to.yaw_rad)[..., None]
    sin = np.sin(to.yaw_rad)[..., None]
    along = np.abs(cos * relative[..., 0] + sin * relative[..., 1]) - to.length_m / 2
    across = np.abs(cos * relative[..., 1] - sin * relative[..., 0]) - to.width_m / 2
    return np.asarray(np.hypot(np.maximum(along, 0.0), np.maximum(across, 0.0)).min(axis=-1))
