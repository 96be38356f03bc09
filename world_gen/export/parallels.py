"""Parallels of a polyline that keep its number of points and never run backwards."""

from __future__ import annotations

import numpy as np

from foretwin.contracts.arrays import Array, Indices
from foretwin.geometry.polyline import meeting, mitres

_SHORTEST_M = 0.002
"""Shorter steps vanish when coordinates are rounded to millimetres."""
_LOOP_POINTS = 100
"""A loop on the inside of a bend is looked for this many points to both sides."""


def parallel(
    xy_m: Array, left_m: Array, *, before: Array | None = None, after: Array | None = None
) -> Array:
    """Return parallels (M, N, 2) of a line (N, 2) at distances (M,) to its left, in metres.

    `before` and `after` are unit directions (2,) of what continues the line beyond its ends, so
    that parallels of consecutive lines meet. Points of one index lie on one ray across the line,
    but on the inside of bends too tight for the distance, where loops are cut off.
    """
    d, normal, stretch = mitres(xy_m, before=before, after=after)
    rays = normal * stretch[:, None]
    lines: Array = xy_m + left_m[:, None, None] * rays
    forward = (np.diff(lines, axis=1) * d).sum(axis=2) > _SHORTEST_M
    for i in np.nonzero(~forward.all(axis=1))[0]:
        kept, rays_kept = _forward_part(lines[i], d)
        if len(kept) == 2 and (kept[1] - kept[0]) @ d.sum(axis=0) <= 0.0:
            # A bend tighter than the distance from end to end: its centre is all that is left.
            kept = np.broadcast_to(kept.mean(axis=0), kept.shape)
        lines[i] = _spread(kept, rays_kept)
    return lines


def untangled(line: Array, directions: Array) -> Array:
    """Return a line (N, 2) without the stretches that run against `directions` (N - 1, 2).

    Both ends stay where they are, and there are N points again.
    """
    return _spread(*_forward_part(line, directions))


def _forward_part(line: Array, directions: Array) -> tuple[Array, Indices]:
    """Return what does not run backwards of a line (N, 2), and on which ray each point lies."""
    points, ahead, rays = line, directions, np.arange(len(line))
    for _ in range(len(line)):
        forward = (np.diff(points, axis=0) * ahead).sum(axis=1) > _SHORTEST_M
        if forward.all() or len(points) == 2:
            break
        points, ahead, rays = _without_loop(points, ahead, rays, int(np.argmin(forward)))
    return points, rays


def _spread(points: Array, rays: Indices) -> Array:
    """Return a line with a point on each ray: those that were cut off lie between the others.

    So points of one ray stay beside each other. Where there is no room for that, the longest
    steps are parted.
    """
    every = np.arange(rays[-1] + 1)
    line = np.column_stack([np.interp(every, rays, points[:, axis]) for axis in (0, 1)])
    if (np.hypot(*np.diff(line, axis=0).T) > _SHORTEST_M).all():
        return line
    return filled(points, len(every))


def _without_loop(
    points: Array, ahead: Array, rays: Indices, at: int
) -> tuple[Array, Array, Indices]:
    """Cut off the loop around the backward step `at`, or one of the step's ends."""
    low, high = max(at - _LOOP_POINTS, 0), min(at + _LOOP_POINTS, len(points) - 1)
    met = _meeting(points[low : at + 2], points[at : high + 1])
    if met is None:
        drop = at + 1 if at + 1 < len(points) - 1 else at
        kept = np.delete(points, drop, axis=0)
        return kept, np.delete(ahead, min(drop, len(ahead) - 1), axis=0), np.delete(rays, drop)
    i, j, where = met
    i, j = low + i, at + j
    kept = np.concatenate([points[: i + 1], where[None], points[j + 1 :]])
    middle = (rays[i] + rays[j + 1]) // 2
    rays = np.concatenate([rays[: i + 1], [middle], rays[j + 1 :]])
    return kept, np.concatenate([ahead[: i + 1], ahead[j:]]), rays


def _meeting(first: Array, second: Array) -> tuple[int, int, Array] | None:
    """Return the farthest apart segments of two lines that cross, and where they do."""
    a, u = first[:-1, None], np.diff(first, axis=0)[:, None]
    b, v = second[None, :-1], np.diff(second, axis=0)[None]
    s, t = meeting(a, u, b, v, parallel=1e-12)
    inside = (s > 0.0) & (s < 1.0) & (t > 0.0) & (t < 1.0)
    if not inside.any():
        return None
    i, j = np.nonzero(inside)
    apart = int(np.argmax(j - i))
    i0, j0 = int(i[apart]), int(j[apart])
    return i0, j0, first[i0] + s[i0, j0] * (first[i0 + 1] - first[i0])


def filled(line: Array, count: int) -> Array:
    """Return the line with its longest steps parted until it has `count` points."""
    if len(line) == count:
        return line
    steps = np.hypot(*np.diff(line, axis=0).T)
    parts = np.ones(len(steps), dtype=np.int64)
    for _ in range(count - len(line)):
        parts[int(np.argmax(steps / parts))] += 1
    pieces = [
        line[i] + np.linspace(0.0, 1.0, n, endpoint=False)[:, None] * (line[i + 1] - line[i])
        for i, n in enumerate(parts.tolist())
    ]
    return np.concatenate([*pieces, line[-1:]])
