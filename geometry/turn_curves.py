"""The paths of turns: straight pieces and at most two arcs, as wide as the place allows."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.geometry.polyline import Flags, cross, left_of, turn_rad
from foretwin.geometry.polyline_batch import Polylines

WANTED_RADIUS_M = 4.5
"""Tighter arcs count as longer. Chosen: a little wider than the tightest that cars turn."""
LEAST_DRAWN_M = 0.2
"""Tighter arcs are no path: a wheel is larger, and the millimetre grid would bend them."""
LEAD_M = 0.4
"""Straight before the first and behind the last arc, so that paths leave along their lanes."""
_STEP_RAD, _STEP_M = math.radians(8.0), 0.5
_REPEAT_M = 0.02
_TIGHTNESS = 8.0


class Turns(NamedTuple):
    """Paths from lane to lane, and the radius in metres of the tightest arc of each, (K,).

    A radius of 0 means that there is no room for any: the path is then no more than a chord.
    """

    lines: Polylines
    radius_m: Array


class _Paths(NamedTuple):
    """A straight `before_m`, an arc, a second arc, a straight `after_m`; arcs signed, left > 0."""

    before_m: Array
    first_rad: Array
    second_rad: Array
    after_m: Array
    radius_m: Array

    def where(self, better: Flags, other: _Paths) -> _Paths:
        return _Paths(*(np.where(better, b, a) for a, b in zip(self, other, strict=True)))


def turn_curves(start: Array, heading: Array, end: Array, end_heading: Array) -> Turns:
    """Return smooth paths from `start` to `end`, tangent to both headings; all are (K, 2).

    Where the tangents meet ahead a path is one arc with the largest radius that fits; else, and
    where that arc is tighter than a car can drive, it may be two arcs, the first to the other
    side. Of the choices the one that turns least counts, tight ones counting as longer. Ends are
    kept to the last bit; other points lie on the millimetre grid.
    """
    chord = end - start
    lead = np.minimum(LEAD_M, 0.15 * np.hypot(chord[:, 0], chord[:, 1]))
    p, q = start + lead[:, None] * heading, end - lead[:, None] * end_heading
    gap = q - p
    angle = turn_rad(heading, end_heading)
    best = _straight(gap, heading)
    cost = np.where((np.abs(angle) < 0.005) & (np.abs(cross(heading, gap)) < 0.003), -1.0, np.inf)
    for side in (1.0, -1.0):
        for found in (
            _one_arc(gap, heading, end_heading, side * angle % math.tau, side),
            _two_arcs(gap, heading, end_heading, side),
        ):
            turned = np.abs(found.first_rad) + np.abs(found.second_rad)
            tight = np.maximum(1.0 - found.radius_m / WANTED_RADIUS_M, 0.0)
            worth = turned + _TIGHTNESS * tight
            worth[~(found.radius_m > LEAST_DRAWN_M)] = np.inf
            better = worth < cost - 1e-6
            best, cost = best.where(better, found), np.where(better, worth, cost)
    drawn = _drawn(start, end, p, q, heading, end_heading, best)
    return Turns(drawn.lines, np.where(np.isfinite(cost), drawn.radius_m, 0.0))


def _dot(a: Array, b: Array) -> Array:
    return np.asarray((a * b).sum(axis=1))


def _straight(gap: Array, heading: Array) -> _Paths:
    none = np.zeros(len(gap))
    return _Paths(none, none, none, none, np.full(len(gap), np.inf))


def _one_arc(gap: Array, u: Array, v: Array, turn: Array, side: float) -> _Paths:
    """Return the widest arc of `turn` radians to one side, with a straight before or behind."""
    share = np.maximum(1.0 - np.cos(turn), 1e-9)
    by_start, by_end = side * cross(gap, v) / share, side * cross(u, gap) / share
    radius = np.where(turn <= math.pi, np.minimum(by_start, by_end), np.maximum(by_start, by_end))
    sin, cos = np.sin(turn), 1.0 - np.cos(turn)
    left = left_of(u) * side
    rest = gap - radius[:, None] * (sin[:, None] * u + cos[:, None] * left)
    before, behind = _dot(rest, u), _dot(rest, v)
    ahead = (np.abs(cross(rest, u)) <= np.abs(cross(rest, v)) + 1e-6) & (before > 0.0)
    before, behind = np.where(ahead, before, 0.0), np.where(ahead, 0.0, behind)
    valid = (radius > 0.05) & (radius < 1e5) & (behind > -1e-6)
    valid &= (turn > 1e-4) & (turn < math.tau - 1e-4)
    none = np.zeros(len(gap))
    return _Paths(before, side * turn, none, behind, np.where(valid, radius, np.nan))


def _two_arcs(gap: Array, u: Array, v: Array, side: float) -> _Paths:
    """Return two arcs of one radius, the first to `side`, the second back, that just touch."""
    left_u = left_of(u) * side
    left_v = left_of(v) * side
    # |gap - R (left_u + left_v)| = 2 R, solved for R.
    both = _dot(gap, left_u + left_v)
    quarter = np.maximum(2.0 - 2.0 * _dot(u, v), 0.0)
    square = _dot(gap, gap)
    below = both + np.sqrt(both * both + quarter * square)
    radius = square / np.maximum(below, 1e-12)
    radius = np.where((below > 1e-9) & (radius < 1e5), radius, np.nan)
    first_centre = radius[:, None] * left_u
    touch = 0.5 * (first_centre + gap - radius[:, None] * left_v)
    spoke, to_touch = -left_u, (touch - first_centre) / radius[:, None]
    first = side * turn_rad(spoke, to_touch) % math.tau
    second = -side * turn_rad(-to_touch, left_v) % math.tau
    first = np.where(first > math.tau - 1e-6, 0.0, first)
    second = np.where(second > math.tau - 1e-6, 0.0, second)
    none = np.zeros(len(gap))
    return _Paths(none, side * first, -side * second, none, radius)


def _drawn(
    start: Array, end: Array, p: Array, q: Array, u: Array, v: Array, paths: _Paths
) -> Turns:
    """Return the points of paths: ends, corners between pieces, and points on the arcs."""
    count = len(start)
    radius = np.where(np.isfinite(paths.radius_m), paths.radius_m, 0.0)
    arcs = np.stack([paths.first_rad, paths.second_rad])
    size = np.abs(arcs)
    most = np.maximum(np.floor(size * radius / _STEP_M), 1.0)
    steps = np.clip(np.ceil(size / _STEP_RAD), 1.0, most).astype(np.int64)
    steps = np.where(size > 0.0, steps, 0)
    counts = 3 + steps[0] + steps[1] + 2
    first_of = np.concatenate([[0], np.cumsum(counts)])
    xy = np.empty((first_of[-1], 2))
    head, tail = first_of[:-1], first_of[1:] - 1
    xy[head], xy[tail] = start, end
    xy[head + 1], xy[tail - 1] = p, q
    begin = p + paths.before_m[:, None] * u
    xy[head + 2] = begin
    yaw = np.arctan2(u[:, 1], u[:, 0])
    offset = head + 3
    for arc, n in zip(arcs, steps, strict=True):
        at = np.repeat(np.arange(count), n)
        if len(at):
            number = np.arange(len(at)) - np.repeat(np.cumsum(n) - n, n) + 1
            side = np.sign(arc)[at] * radius[at]
            turned = yaw[at] + arc[at] * number / n[at]
            rows = offset[at] + number - 1
            xy[rows, 0] = begin[at, 0] + side * (np.sin(turned) - np.sin(yaw[at]))
            xy[rows, 1] = begin[at, 1] - side * (np.cos(turned) - np.cos(yaw[at]))
            begin = np.where((n > 0)[:, None], xy[np.maximum(offset + n - 1, 0)], begin)
            yaw = yaw + arc
        offset = offset + n
    middle = np.ones(len(xy), dtype=bool)
    middle[head] = middle[tail] = False
    xy[middle] = np.round(xy[middle], 3)
    return Turns(_without_repeats(Polylines(xy, first_of)), paths.radius_m)


def _without_repeats(lines: Polylines) -> Polylines:
    near = np.concatenate([[False], lines.steps[1][:-1] < _REPEAT_M])
    near[lines.first[:-1]] = near[lines.first[1:] - 1] = False
    lines = lines.keep(~near)
    # What lies just before the end goes too.
    near = lines.steps[1] < _REPEAT_M
    near[lines.first[1:] - 1] = near[lines.first[:-1]] = False
    return lines.keep(~near)
