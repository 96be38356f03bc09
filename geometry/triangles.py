"""Flat areas as triangles."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import shapely

from foretwin.contracts.arrays import Array, Indices
from foretwin.geometry.polyline import cross
from foretwin.geometry.reflex_cuts import Geometries

_PER_M = 1e4
"""Corners nearer than a step of this grid are one."""


class Triangles(NamedTuple):
    """Corners (T, 3, 2) of triangles, counter-clockwise, and (T,) of which shape each is a part."""

    corners_m: Array
    owner: Indices


class TriangleMesh(NamedTuple):
    """Points (N, 2), each once, and triangles (T, 3) of their rows, counter-clockwise."""

    xy_m: Array
    triangles: Indices


def triangulated(shapes: Geometries) -> Triangles:
    """Cut valid polygons, or what holds such, into triangles that have no corner of their own."""
    pieces, owner = shapely.get_parts(
        shapely.constrained_delaunay_triangles(shapes), return_index=True
    )
    corners = shapely.get_coordinates(pieces).reshape(-1, 4, 2)[:, :3]
    clockwise = twice_areas_m2(corners) < 0.0
    corners[clockwise] = corners[clockwise][:, ::-1]
    return Triangles(corners, owner)


def twice_areas_m2(corners_m: Array) -> Array:
    """Return twice the areas (T,) of triangles (T, 3, 2 or more) seen from above.

    They are negative where corners run clockwise.
    """
    first = corners_m[:, 0]
    return cross(corners_m[:, 1] - first, corners_m[:, 2] - first)


def joined(corners_m: Array, *, sliver_m2: float) -> TriangleMesh:
    """Return triangles (T, 3, 2) with their corners shared, on a grid of 0.1 mm.

    Those whose area, twice, is no more than `sliver_m2` there are left out.
    """
    steps = np.rint(corners_m.reshape(-1, 2) * _PER_M).astype(np.int64)
    _, first, rows = np.unique(
        (steps[:, 0] << 32) + steps[:, 1], return_index=True, return_inverse=True
    )
    xy = np.round(corners_m.reshape(-1, 2)[first], 4)
    return TriangleMesh(xy, upward(xy, rows.reshape(-1, 3), sliver_m2=sliver_m2))


def upward(points_m: Array, triangles: Indices, *, sliver_m2: float) -> Indices:
    """Return triangles (T, 3) of rows of points, counter-clockwise seen from above.

    Those whose area, twice, is no more than `sliver_m2` are left out.
    """
    twice = twice_areas_m2(points_m[triangles])
    turned = np.where((twice < 0.0)[:, None], triangles[:, ::-1], triangles)
    return turned[np.abs(twice) > sliver_m2]
