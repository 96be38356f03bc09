"""Polygons with holes cut into few convex pieces, since a mesh collides as its convex hull."""

from __future__ import annotations

import numpy as np
import shapely
from shapely.geometry import Polygon
from shapely.geometry.polygon import orient

from contracts.arrays import Array

_STRAIGHT = 1e-3


def convex_parts(
    outline: Array, holes: tuple[Array, ...] = (), *, tolerance_m: float = 0.25
) -> list[Array]:
    """Return convex pieces (N, 2), counter-clockwise, that cover a polygon.

    The outline is simplified, and taken for its convex hull, as far as its silhouette moves by
    no more than `tolerance_m`. Pieces are a constrained Delaunay triangulation merged across
    inner edges while the result stays convex (Hertel and Mehlhorn 1983).
    """
    shape = Polygon(outline, holes)
    if not shape.is_valid:
        shape = shapely.make_valid(shape)
    pieces: list[Array] = []
    for polygon in shapely.get_parts(shape):
        if isinstance(polygon, Polygon) and polygon.area > 0.05:
            pieces.extend(_parts(polygon, tolerance_m))
    return pieces


def _parts(polygon: Polygon, tolerance_m: float) -> list[Array]:
    # Half of the tolerance for simplifying, half for notches that the hull fills.
    simple = polygon.simplify(tolerance_m / 2, preserve_topology=True)
    if not isinstance(simple, Polygon) or not simple.is_valid or simple.area < 0.05:
        simple = polygon
    hull = simple.convex_hull
    if (
        not simple.interiors
        and shapely.hausdorff_distance(hull.exterior, simple.exterior) <= tolerance_m / 2
    ):
        return [_ring(hull)]
    triangles = [
        _ring(t) for t in shapely.constrained_delaunay_triangles(simple).geoms if t.area > 1e-4
    ]
    return _merged(triangles)


def _ring(polygon: Polygon) -> Array:
    points: Array = shapely.get_coordinates(orient(polygon).exterior)[:-1]
    return points


def _merged(triangles: list[Array]) -> list[Array]:
    corners, rows = np.unique(np.round(np.concatenate(triangles), 6), axis=0, return_inverse=True)
    names = rows.reshape(-1, 3).tolist()
    xy = corners.tolist()
    pieces: dict[int, list[int]] = dict(enumerate(names))
    owner: dict[tuple[int, int], int] = {}
    for piece, ring in pieces.items():
        for k in range(3):
            owner[ring[k], ring[(k + 1) % 3]] = piece
    inner = [edge for edge in owner if edge[0] < edge[1] and (edge[1], edge[0]) in owner]
    inner.sort(key=lambda e: -_length2(xy[e[0]], xy[e[1]]))
    for a, b in inner:
        left, right = owner[a, b], owner[b, a]
        if left == right:
            continue
        merged = _join(pieces[left], pieces[right], a, b)
        if merged is None or not _convex(merged, xy, (a, b)):
            continue
        del pieces[right]
        pieces[left] = merged
        for k, corner in enumerate(merged):
            owner[corner, merged[(k + 1) % len(merged)]] = left
    return [np.array([xy[i] for i in ring]) for ring in pieces.values()]


def _length2(a: list[float], b: list[float]) -> float:
    return (a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2


def _join(left: list[int], right: list[int], a: int, b: int) -> list[int] | None:
    """Return the ring of two pieces without their common edge a→b (b→a in `right`)."""
    i, j = left.index(b), right.index(a)
    ring = left[i:] + left[:i] + (right[j:] + right[:j])[1:-1]
    return ring if len(set(ring)) == len(ring) else None


def _convex(ring: list[int], xy: list[list[float]], corners: tuple[int, int]) -> bool:
    n = len(ring)
    for corner in corners:
        k = ring.index(corner)
        p, q, r = xy[ring[k - 1]], xy[corner], xy[ring[(k + 1) % n]]
        if (q[0] - p[0]) * (r[1] - q[1]) - (q[1] - p[1]) * (r[0] - q[0]) < -_STRAIGHT:
            return False
    return True
