"""Roofs over outlines as triangles: how high each form stands over each point of its building.

Forms as in https://wiki.openstreetmap.org/wiki/Simple_3D_Buildings. In the outline's smallest
rectangle u runs along the ridge and v across, both from -1 to 1; `steep` is the rectangle's half
length over its half width, so that hips rise as fast as the sides do.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
import shapely

from foretwin.contracts.arrays import Array, Indices
from foretwin.contracts.beside_road import RoofForm
from foretwin.geometry.triangles import TriangleMesh, joined, triangulated

_CURVED_PIECES = 6
"""On each side of the middle: an arch of so many straight pieces is off by 1.2 % of its height."""
_SLIVER_M2 = 1e-4
_UPRIGHT_M = 0.01
"""Edges of a roof that end so near the eaves have no wall below them."""
_GRID_M = 1e-4

_Rise = Callable[[Array, Array, float], Array]


class RoofMesh(NamedTuple):
    """Points (N, 3) in the outline's frame, and triangles (M, 3) seen from outside."""

    points: Array
    triangles: Indices


def roof_mesh(
    outline: Array,
    holes: Sequence[Array] = (),
    *,
    form: RoofForm,
    ridge_rad: float,
    eaves_m: float,
    top_m: float,
) -> RoofMesh:
    """Return a roof from the eaves up to its top over an outline (N, 2) with holes.

    `ridge_rad` is the ridge's direction, counter-clockwise from x; a `skillion` falls to the
    left of it. Gables are closed by upright triangles; the underside is open.
    """
    shape = shapely.Polygon(outline, list(holes))
    if not shape.is_valid:
        shape = shapely.make_valid(shape)
    along = np.array([math.cos(ridge_rad), math.sin(ridge_rad)])
    axes = np.stack([along, [-along[1], along[0]]])
    turned = outline @ axes.T
    centre, half_m = (turned.max(0) + turned.min(0)) / 2.0, np.ptp(turned, axis=0) / 2.0
    half_m = np.maximum(half_m, _GRID_M)
    steep = float(half_m[0] / half_m[1])
    creases = [(np.array(line) * half_m + centre) @ axes for line in _creases(form, steep)]
    xy, triangles = _cut_into_triangles(shape, creases)
    u, v = ((xy @ axes.T - centre) / half_m).clip(-1.0, 1.0).T
    high = eaves_m + (top_m - eaves_m) * _RISES[form](u, v, steep)
    return _with_gables(np.column_stack([xy, high]), triangles, eaves_m)


def _cut_into_triangles(shape: shapely.Geometry, creases: Sequence[Array]) -> TriangleMesh:
    """Return triangles that no crease crosses."""
    lines = [shapely.boundary(shape), *(shapely.LineString(line) for line in creases)]
    cells = shapely.get_parts(shapely.polygonize([shapely.union_all(lines, grid_size=_GRID_M)]))
    inside = shapely.contains(shapely.buffer(shape, _GRID_M), shapely.point_on_surface(cells))
    return joined(triangulated(cells[inside]).corners_m, sliver_m2=2.0 * _SLIVER_M2)


def _with_gables(points: Array, triangles: Indices, eaves_m: float) -> RoofMesh:
    """Close what stands open between the roof's rim and its eaves."""
    edges = np.concatenate([triangles[:, [k, (k + 1) % 3]] for k in range(3)])
    known = {(a, b) for a, b in edges.tolist()}
    rim = np.array([(a, b) for a, b in sorted(known) if (b, a) not in known], dtype=np.intp)
    rim = rim.reshape(-1, 2)
    rim = rim[(points[rim, 2] > eaves_m + _UPRIGHT_M).any(axis=1)]
    feet = points[rim.ravel()].copy()
    feet[:, 2] = eaves_m
    left, right = len(points) + np.arange(len(feet)).reshape(-1, 2).T
    walls = [np.stack([left, right, rim[:, 1]], 1), np.stack([left, rim[:, 1], rim[:, 0]], 1)]
    joined, faces = np.concatenate([points, feet]), np.concatenate([triangles, *walls])
    a, b, c = (joined[faces[:, k]] for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    return RoofMesh(joined, faces[area > _SLIVER_M2])


def _creases(form: RoofForm, steep: float) -> list[list[tuple[float, float]]]:
    """Return the lines in (u, v) along which a form bends."""
    hips = [
        [(su, sv), (su * (1.0 - end / steep), sv * (1.0 - end))]
        for su in (-1, 1)
        for sv in (-1, 1)
        for end in [min(1.0, steep)]
    ]
    ridge, across = [[(-2.0, 0.0), (2.0, 0.0)]], [[(0.0, -2.0), (0.0, 2.0)]]
    middle = [*ridge, *across]
    if form == "skillion":
        return []
    if form in ("gabled", "gambrel"):
        levels = (0.0,) if form == "gabled" else (-_KNEE, 0.0, _KNEE)
        return [[(-2.0, v), (2.0, v)] for v in levels]
    if form == "half_hipped":
        end = min(0.5, steep)
        return ridge + [
            [(su, sv * 0.5), (su * (1.0 - end / steep), sv * (0.5 - end))]
            for su in (-1, 1)
            for sv in (-1, 1)
        ]
    if form == "pyramidal":
        return [*middle, [(-1.0, -1.0), (1.0, 1.0)], [(-1.0, 1.0), (1.0, -1.0)]]
    if form == "mansard":
        u, v = 1.0 - min(_LEDGE, steep) / steep, 1.0 - min(_LEDGE, steep)
        ledge = [(-u, -v), (u, -v), (u, v), (-u, v), (-u, -v)]
        return [*hips, *middle, ledge]
    if form == "hipped":
        return [*hips, *middle]
    steps = np.sin(np.linspace(-math.pi / 2.0, math.pi / 2.0, 2 * _CURVED_PIECES + 1)[1:-1])
    lines: list[list[tuple[float, float]]] = [[(-2.0, v), (2.0, v)] for v in steps.tolist()]
    if form == "dome":
        lines += [[(u, -2.0), (u, 2.0)] for u in steps.tolist()]
    return lines


_KNEE = 0.5
_KNEE_RISE = 0.7
"""A gambrel bends half way to the ridge, at this share of its height. Chosen."""
_LEDGE = 0.3
_LEDGE_RISE = 0.75
"""A mansard's steep part ends there. Chosen."""


def _hip(u: Array, v: Array, steep: float) -> Array:
    inward = np.minimum(1.0 - np.abs(v), (1.0 - np.abs(u)) * steep)
    rise: Array = inward / min(1.0, steep)
    return rise


_RISES: dict[RoofForm, _Rise] = {
    "gabled": lambda _, v, __: 1.0 - np.abs(v),
    "hipped": _hip,
    "half_hipped": lambda u, v, s: np.minimum(1.0 - np.abs(v), 0.5 + (1.0 - np.abs(u)) * s),
    "pyramidal": lambda u, v, _: 1.0 - np.maximum(np.abs(u), np.abs(v)),
    "skillion": lambda _, v, __: (1.0 - v) / 2.0,
    "gambrel": lambda _, v, __: np.interp(
        1.0 - np.abs(v), [0.0, 1.0 - _KNEE, 1.0], [0.0, _KNEE_RISE, 1.0]
    ),
    "mansard": lambda u, v, s: np.interp(_hip(u, v, s), [0.0, _LEDGE, 1.0], [0.0, _LEDGE_RISE, 1]),
    "round": lambda _, v, __: np.sqrt(1.0 - v * v),
    "dome": lambda u, v, _: np.sqrt(np.maximum(0.0, 1.0 - u * u - v * v)),
}
"""How high a form stands over (u, v), from 0 at the eaves to 1 at its top."""
