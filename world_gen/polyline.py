"""Polylines as (N, 2) arrays of metres: lengths, cuts, offsets, and the curves of turns."""

from __future__ import annotations

import math

import numpy as np

from contracts.arrays import Array

_MITRE_LIMIT = 2.0


def arc_lengths(xy_m: Array) -> Array:
    """Return (N,) metres from the first point along the polyline."""
    steps = np.hypot(*np.diff(xy_m, axis=0).T)
    return np.concatenate([[0.0], np.cumsum(steps)])


def length(xy_m: Array) -> float:
    """Return the length in metres."""
    return float(arc_lengths(xy_m)[-1])


def without_repeats(xy_m: Array, *, tolerance_m: float = 0.01) -> Array:
    """Return the polyline without points closer than `tolerance_m` to the one before."""
    if len(xy_m) < 2:
        return xy_m
    keep = np.concatenate([[True], np.hypot(*np.diff(xy_m, axis=0).T) > tolerance_m])
    kept: Array = xy_m[keep]
    return kept


def points_at(xy_m: Array, at_m: Array | float) -> Array:
    """Return the points (M, 2), or (2,), at arc lengths `at_m` (clamped to the ends)."""
    s = arc_lengths(xy_m)
    return np.stack([np.interp(at_m, s, xy_m[:, 0]), np.interp(at_m, s, xy_m[:, 1])], axis=-1)


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


def left_of(direction: Array) -> Array:
    """Return the direction (..., 2) turned 90° counter-clockwise."""
    return np.stack([-direction[..., 1], direction[..., 0]], axis=-1)


def offset(
    xy_m: Array,
    left_m: float,
    *,
    before: Array | None = None,
    after: Array | None = None,
) -> Array:
    """Return the polyline shifted to its left by `left_m` (negative: to its right).

    `before` and `after` are unit directions (2,) of the road that continues beyond the ends, so
    that shifted pieces of one road meet. Stretches that would run backwards are left out.
    """
    if abs(left_m) < 1e-9:
        return xy_m.copy()
    d = np.diff(xy_m, axis=0)
    d /= np.maximum(np.hypot(d[:, 0], d[:, 1]), 1e-9)[:, None]
    first = d[:1] if before is None else before[None]
    last = d[-1:] if after is None else after[None]
    incoming = np.concatenate([first, d])
    outgoing = np.concatenate([d, last])
    normal = left_of(incoming) + left_of(outgoing)
    norm = np.hypot(normal[:, 0], normal[:, 1])
    normal = np.where(norm[:, None] > 0.2, normal / np.maximum(norm, 0.2)[:, None], left_of(d[[0]]))
    stretch = 1.0 / np.maximum((normal * left_of(outgoing)).sum(axis=1), 1.0 / _MITRE_LIMIT)
    shifted = xy_m + normal * (left_m * stretch)[:, None]
    return _without_backward_runs(shifted, d)


def _without_backward_runs(shifted: Array, directions: Array) -> Array:
    forward = (np.diff(shifted, axis=0) * directions).sum(axis=1) > 0.0
    if forward.all() or not forward.any():
        return shifted
    keep = np.concatenate([forward, [True]]) & np.concatenate([[True], forward])
    keep[0] = keep[-1] = True
    kept: Array = shifted[keep]
    return kept


def rounded(xy_m: Array, *, deviation_m: float = 0.35, share: float = 0.45) -> Array:
    """Return the polyline with bends replaced by arcs that stay within `deviation_m` of it.

    An arc takes at most `share` of the shorter neighbouring segment, so ends and their
    directions stay.
    """
    if len(xy_m) < 3:
        return xy_m
    d = np.diff(xy_m, axis=0)
    seg = np.hypot(d[:, 0], d[:, 1])
    u = d / np.maximum(seg, 1e-9)[:, None]
    bend = np.arctan2(u[:-1, 0] * u[1:, 1] - u[:-1, 1] * u[1:, 0], (u[:-1] * u[1:]).sum(axis=1))
    out = [xy_m[:1]]
    for i, angle in enumerate(np.abs(bend)):
        corner = xy_m[i + 1]
        if angle < math.radians(2.0) or angle > math.radians(150.0):
            out.append(corner[None])
            continue
        # An arc of tangent length t leaves its corner by t (1 - cos(a/2)) / sin(a/2).
        tangent = deviation_m * math.sin(angle / 2) / (1.0 - math.cos(angle / 2))
        tangent = min(tangent, share * seg[i], share * seg[i + 1])
        out.append(_arc(corner, u[i], u[i + 1], tangent, angle))
    out.append(xy_m[-1:])
    return np.concatenate(out)


def _arc(corner: Array, before: Array, after: Array, tangent_m: float, angle: float) -> Array:
    """Return a Bézier arc that rounds `corner` with tangents of `tangent_m`."""
    k = (4.0 / 3.0) * math.tan(angle / 4) / math.tan(angle / 2)
    p0, p3 = corner - before * tangent_m, corner + after * tangent_m
    steps = int(np.clip(math.ceil(angle / math.radians(7.0)), 2, 24))
    return bezier(p0, p0 + before * tangent_m * k, p3 - after * tangent_m * k, p3, steps)


def bezier(p0: Array, p1: Array, p2: Array, p3: Array, steps: int) -> Array:
    """Return `steps` + 1 points of the cubic Bézier curve with these control points."""
    t = np.linspace(0.0, 1.0, steps + 1)[:, None]
    s = 1.0 - t
    return s**3 * p0 + 3 * s * s * t * p1 + 3 * s * t * t * p2 + t**3 * p3


def turn_curve(start: Array, heading: Array, end: Array, end_heading: Array) -> Array:
    """Return a smooth path (N, 2) from `start` to `end`, tangent to both headings (unit, (2,)).

    Where the two tangents meet ahead it is a straight piece and one arc with the largest
    radius that fits; otherwise one cubic Bézier curve. Points are about a metre apart.
    """
    chord = end - start
    span = math.hypot(chord[0], chord[1])
    if span < 0.05:
        return np.stack([start, end])
    cross = heading[0] * end_heading[1] - heading[1] * end_heading[0]
    angle = abs(math.atan2(cross, float(heading @ end_heading)))
    steps = int(np.clip(math.ceil(max(span, angle / math.radians(7.0))), 8, 40))
    if math.radians(8.0) < angle < math.radians(155.0):
        # start + a heading = end - b end_heading, by Cramer's rule.
        a = (chord[0] * end_heading[1] - chord[1] * end_heading[0]) / cross
        b = (heading[0] * chord[1] - heading[1] * chord[0]) / cross
        if a > 0.3 and b > 0.3:
            tangent = min(a, b)
            corner = start + heading * a
            arc = _arc(corner, heading, end_heading, tangent, angle)
            pieces = [_straight(start, arc[0]), arc, _straight(arc[-1], end)]
            return without_repeats(np.concatenate(pieces))
    reach = span * (0.38 + 0.25 * min(angle / math.pi, 1.0))
    return bezier(start, start + heading * reach, end - end_heading * reach, end, steps)


def _straight(start: Array, end: Array) -> Array:
    gap = math.hypot(*(end - start))
    count = max(int(gap), 1) + 1
    return start + np.linspace(0.0, 1.0, count)[:, None] * (end - start)
