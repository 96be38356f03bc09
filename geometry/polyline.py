"""Polylines as (N, 2) arrays of metres: lengths, places along them, cuts and offsets."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from foretwin.contracts.arrays import Array, Indices

Flags = npt.NDArray[np.bool_]
MITRE_LIMIT = 2.0
"""At bends a parallel is at most so many times its distance away."""


def arc_lengths(xy_m: Array) -> Array:
    """Return (N,) metres from the first point along the polyline."""
    # What diff and concatenate would do too, at twice the cost: nothing is asked for as often.
    found, steps = np.zeros(max(len(xy_m), 1)), xy_m[1:] - xy_m[:-1]
    np.cumsum(np.hypot(steps[:, 0], steps[:, 1]), out=found[1:])
    return found


def length(xy_m: Array) -> float:
    """Return the length in metres."""
    return float(arc_lengths(xy_m)[-1])


def without_repeats(xy_m: Array, *, tolerance_m: float = 0.01) -> Array:
    """Return the polyline without points closer than `tolerance_m` to the one before."""
    if len(xy_m) < 2:
        return xy_m
    kept: Array = xy_m[apart(xy_m, tolerance_m=tolerance_m)]
    return kept


def apart(xy_m: Array, *, tolerance_m: float) -> Flags:
    """Return (N,) whether points are farther than `tolerance_m` from the one before."""
    return np.concatenate([[True], np.hypot(*np.diff(xy_m, axis=0).T) > tolerance_m])


def kept_apart(xy_m: Array, *, least_m: float) -> Indices:
    """Return the rows of those points (N, 2) that lie so far from the last one that was kept."""
    if len(xy_m) == 0 or (np.hypot(*np.diff(xy_m, axis=0).T) >= least_m).all():
        return np.arange(len(xy_m))
    kept = [0]
    for row in range(1, len(xy_m)):
        if np.hypot(*(xy_m[row] - xy_m[kept[-1]])) >= least_m:
            kept.append(row)
    return np.array(kept)


def points_at(xy_m: Array, at_m: Array | float) -> Array:
    """Return the points (M, 2), or (2,), at arc lengths `at_m` (clamped to the ends)."""
    return interpolated(at_m, arc_lengths(xy_m), xy_m)


def interpolated(at: Array | float, known: Array, rows: Array) -> Array:
    """Return the rows (M, K), or (K,), between `rows` (N, K) known at rising numbers (N,).

    They are asked for at `at`, which is clamped to the ends.
    """
    found = np.empty((*np.shape(at), rows.shape[1]))
    for number, column in enumerate(rows.T):
        found[..., number] = np.interp(at, known, column)
    return found


def evenly(length_m: float, *, spacing_m: float) -> Array:
    """Return arc lengths (M,) from 0 to `length_m`, even and at most `spacing_m` apart."""
    return np.linspace(0.0, length_m, max(math.ceil(length_m / spacing_m), 1) + 1)


def densified(xy_m: Array, *, spacing_m: float) -> Array:
    """Return points (M, 2) along the polyline, even and at most `spacing_m` apart."""
    return points_at(xy_m, evenly(length(xy_m), spacing_m=spacing_m))


class Stretches(NamedTuple):
    """Even pieces of a polyline: where their middles lie, as arc lengths (M,) and points (M, 2),
    and the unit directions (M, 2) there."""

    at_m: Array
    xy_m: Array
    direction: Array


def stretches(xy_m: Array, *, spacing_m: float) -> Stretches:
    """Cut a polyline into even pieces of at most `spacing_m`."""
    arc = arc_lengths(xy_m)
    count = max(math.ceil(arc[-1] / spacing_m), 1)
    at = (np.arange(count) + 0.5) * (arc[-1] / count)
    piece = np.clip(np.searchsorted(arc, at, side="right") - 1, 0, len(xy_m) - 2)
    return Stretches(at, interpolated(at, arc, xy_m), units(np.diff(xy_m, axis=0)[piece]))


def direction_at(xy_m: Array, at_m: float) -> Array:
    """Return the unit vector (2,) along the segment that holds arc length `at_m`."""
    s = arc_lengths(xy_m)
    i = int(np.clip(np.searchsorted(s, at_m, side="right") - 1, 0, len(xy_m) - 2))
    return unit(xy_m[i + 1] - xy_m[i])


def cut(xy_m: Array, from_m: float, to_m: float) -> Array:
    """Return the piece between two arc lengths; at least two points."""
    s = arc_lengths(xy_m)
    inside = (s > from_m + 1e-6) & (s < to_m - 1e-6)
    ends = points_at(xy_m, np.array([from_m, to_m]))
    return np.concatenate([ends[:1], xy_m[inside], ends[1:]])


def locate(xy_m: Array, point_m: Array) -> float:
    """Return the arc length of the polyline's point nearest to `point_m` (2,)."""
    a, b = xy_m[:-1], xy_m[1:]
    d = b - a
    norm2 = np.maximum((d * d).sum(axis=1), 1e-12)
    t = np.clip(((point_m - a) * d).sum(axis=1) / norm2, 0.0, 1.0)
    gap = a + t[:, None] * d - point_m
    i = int(np.argmin((gap * gap).sum(axis=1)))
    return float(arc_lengths(xy_m)[i] + t[i] * math.sqrt(norm2[i]))


def unit(vector: Array) -> Array:
    """Return the vector (2,) with length 1, or (1, 0) where it has none."""
    norm = math.hypot(vector[0], vector[1])
    return vector / norm if norm > 1e-9 else np.array([1.0, 0.0])


def units(vectors: Array) -> Array:
    """Return vectors (..., 2) with length 1, but for those shorter than a nanometre."""
    norm = np.hypot(vectors[..., 0], vectors[..., 1])
    return np.asarray(vectors / np.maximum(norm, 1e-9)[..., None])


def tangents(xy_m: Array) -> Array:
    """Return the unit directions (N, 2) at a polyline's points, from those on either side."""
    return units(np.gradient(xy_m, axis=0))


def headings_rad(xy_m: Array) -> Array:
    """Return the angle (N,) of a polyline's directions at its points, as `tangents` has them."""
    step = np.gradient(xy_m, axis=0)
    return np.asarray(np.arctan2(step[:, 1], step[:, 0]))


def left_of(direction: Array) -> Array:
    """Return the direction (..., 2) turned 90° counter-clockwise."""
    return np.stack([-direction[..., 1], direction[..., 0]], axis=-1)


def cross(a: Array, b: Array) -> Array:
    """Return the cross product of vectors (..., 2): positive where b points to the left of a."""
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def meeting(
    a: Array, along_a: Array, b: Array, along_b: Array, *, parallel: float
) -> tuple[Array, Array]:
    """Return where lines through points (..., 2) along vectors cross: how many of each vector (...)
    beyond its point; NaN where their cross product is no more than `parallel`."""
    gap, product = b - a, cross(along_a, along_b)
    product = np.where(np.abs(product) > parallel, product, np.nan)
    return cross(gap, along_b) / product, cross(gap, along_a) / product


def turn_rad(before: Array, after: Array) -> Array:
    """Return (...) the angle from one vector (..., 2) to the next, positive to the left."""
    return np.asarray(np.arctan2(cross(before, after), (before * after).sum(axis=-1)))


class Mitres(NamedTuple):
    """Rays across a polyline that its parallels share: unit vectors (N - 1, 2) along its segments,
    (N, 2) to the left at its points, and (N,) how much farther a parallel is there."""

    directions: Array
    normal: Array
    stretch: Array


def mitres(xy_m: Array, *, before: Array | None = None, after: Array | None = None) -> Mitres:
    """Return the rays at the points (N, 2) of a polyline, as `offset` continues its ends."""
    d = units(np.diff(xy_m, axis=0))
    incoming = np.concatenate([d[:1] if before is None else before[None], d])
    outgoing = np.concatenate([d, d[-1:] if after is None else after[None]])
    return Mitres(d, *rays_between(incoming, outgoing, left_of(d[[0]])))


def rays_between(into: Array, out: Array, otherwise: Array) -> tuple[Array, Array]:
    """Return of bends between unit directions (N, 2) their rays to the left (N, 2), and how much
    farther a parallel is there (N,); `otherwise` stands for the ray where a road turns back."""
    normal = left_of(into + out)
    norm = np.hypot(normal[:, 0], normal[:, 1])[:, None]
    normal = np.where(norm > 0.2, normal / np.maximum(norm, 0.2), otherwise)
    stretch = 1.0 / np.maximum((normal * left_of(out)).sum(axis=1), 1.0 / MITRE_LIMIT)
    return normal, stretch


def offset(
    xy_m: Array, left_m: float, *, before: Array | None = None, after: Array | None = None
) -> Array:
    """Return the polyline shifted to its left by `left_m` (negative: to its right).

    `before` and `after` are unit directions (2,) of the road that continues beyond the ends, so
    that shifted pieces of one road meet. Stretches that would run backwards are left out.
    """
    if abs(left_m) < 1e-9:
        return xy_m.copy()
    ray = mitres(xy_m, before=before, after=after)
    return _without_backward_runs(xy_m + ray.normal * (left_m * ray.stretch)[:, None], xy_m)


def _without_backward_runs(shifted: Array, line: Array) -> Array:
    forward = (np.diff(shifted, axis=0) * np.diff(line, axis=0)).sum(axis=1) > 0.0
    if forward.all() or not forward.any():
        return shifted
    keep = np.concatenate([forward, [True]]) & np.concatenate([[True], forward])
    keep[0] = keep[-1] = True
    # What is then joined may run backwards, too.
    return shifted if keep.all() else _without_backward_runs(shifted[keep], line[keep])
