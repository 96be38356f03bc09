"""Smooth curves through polylines: straight pieces and cubics that share point and heading.

OpenDRIVE's reference lines must not bend at a point, or lanes beside them would tear open. Long
segments of a polyline stay straight, corners between them are rounded within 2 cm, and stretches
of short segments, which are sampled curves, become cubics that stay within 2 cm of their points.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import shapely

from foretwin.contracts.arrays import Array
from foretwin.geometry.polyline import cross, unit, without_repeats

STRAIGHT_M = 3.0
"""Longer segments are taken for straight; the World samples its curves more densely."""
FIT_M = 0.02
CORNER_M = 0.02
SIMPLIFY_M = 0.004
END_BEND_M = 5.0
"""Within this distance of its end a straight takes up the heading that is required there."""
TILT_M = 0.01
"""So far the second point may give way to the heading that is required at the first."""
_SAME_HEADING = 1e-7
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(16)


@dataclass(frozen=True, slots=True)
class Curve:
    """A chain of cubic Bézier curves: `controls` (N, 4, 2), `straight` (N,), `lengths_m` (N,)."""

    controls: Array
    straight: tuple[bool, ...]
    lengths_m: Array

    @property
    def length_m(self) -> float:
        """Length in metres."""
        return float(self.lengths_m.sum())

    def end(self, *, at_end: bool) -> tuple[Array, Array]:
        """Return point (2,) and unit direction (2,) at the start or end."""
        p = self.controls[-1 if at_end else 0]
        return (p[3], unit(p[3] - p[2])) if at_end else (p[0], unit(p[1] - p[0]))

    def at(self, s_m: Array | float) -> tuple[Array, Array]:
        """Return points (M, 2) and unit directions (M, 2) at arc lengths `s_m` (M,)."""
        s = np.atleast_1d(np.asarray(s_m, dtype=np.float64))
        starts = np.concatenate([[0.0], np.cumsum(self.lengths_m)])
        piece = np.clip(np.searchsorted(starts, s, side="right") - 1, 0, len(self.lengths_m) - 1)
        # As OpenDRIVE reads a normalised cubic: its parameter runs evenly with the length.
        t = np.clip((s - starts[piece]) / self.lengths_m[piece], 0.0, 1.0)[:, None]
        points, step = _evaluated(self.controls[piece], t)
        return points, step / np.maximum(np.hypot(step[:, 0], step[:, 1]), 1e-12)[:, None]

    def locate(self, points_m: Array) -> tuple[Array, Array]:
        """Return arc length and distance to the left (M,) of the nearest place to (M, 2) points."""
        points = np.atleast_2d(points_m)
        sample = np.linspace(0.0, self.length_m, max(int(self.length_m / 4.0), 1) + 1)
        on_curve, _ = self.at(sample)
        line = shapely.LineString(on_curve)
        share = shapely.line_locate_point(line, shapely.points(points), normalized=True)
        s = share * self.length_m
        for _ in range(3):
            near, direction = self.at(s)
            s = np.clip(s + ((points - near) * direction).sum(axis=1), 0.0, self.length_m)
        near, direction = self.at(s)
        gap = points - near
        return s, cross(direction, gap)


def fit_curve(line: Array, *, start: Array | None = None, end: Array | None = None) -> Curve:
    """Return the curve through a polyline (N, 2).

    `start` and `end` are unit directions (2,) at its ends; without, those of its end segments.
    Raises ValueError where the polyline has no length.
    """
    xy = without_repeats(np.asarray(line, dtype=np.float64), tolerance_m=1e-6)
    if len(xy) < 2:
        raise ValueError("a road's reference line has no length")
    # Lanes end across the line's own first and last step, however short they are.
    first = unit(xy[1] - xy[0]) if start is None else start
    last = unit(xy[-1] - xy[-2]) if end is None else end
    if len(xy) > 2:
        xy = shapely.get_coordinates(shapely.simplify(shapely.LineString(xy), SIMPLIFY_M))
    if len(xy) == 2 and _nearly_straight(xy, first, last):
        return curve_between(xy[0], first, xy[1], last)
    xy = _tilted(xy, first, last)
    steps = np.diff(xy, axis=0)
    lengths = np.hypot(steps[:, 0], steps[:, 1])
    directions = steps / lengths[:, None]
    controls = _chain(xy, lengths, directions, first, last)
    pieces = np.array([piece for piece, _ in controls])
    return Curve(pieces, tuple(straight for _, straight in controls), _lengths(pieces))


def curve_between(begin: Array, heading: Array, finish: Array, toward: Array) -> Curve:
    """Return one cubic from a point (2,) and unit direction (2,) to another."""
    piece = np.array([_arc_like(begin, heading, finish, toward)])
    return Curve(piece, (False,), _lengths(piece))


Piece = tuple[Array, bool]


def _nearly_straight(xy: Array, first: Array, last: Array) -> bool:
    """Return whether one cubic between two points (2, 2) stays within `FIT_M` of the straight."""
    span = xy[1] - xy[0]
    bend = max(abs(_bend(span, first)), abs(_bend(span, last)))
    # A cubic leaves its chord by at most 4/27 of its length times the slope at one end.
    return 0.0 < bend < 0.5 and 4.0 / 27.0 * math.hypot(*span) * math.tan(bend) < FIT_M


def _tilted(xy: Array, first: Array, last: Array) -> Array:
    """Move the points next to the ends onto the headings there where they lie close to them.

    Points are rounded to millimetres, so that a straight would need a bend at its end else.
    """
    if len(xy) < 4:
        return xy
    moved = xy.copy()
    for corner, beside, heading in ((0, 1, first), (-1, -2, last)):
        gap = xy[beside] - xy[corner]
        onto = xy[corner] + heading * float(gap @ heading)
        if math.hypot(*(onto - xy[beside])) <= TILT_M:
            moved[beside] = onto
    return moved


def _chain(xy: Array, lengths: Array, directions: Array, first: Array, last: Array) -> list[Piece]:
    count = len(lengths)
    long = [bool(length >= STRAIGHT_M) for length in lengths]
    cuts = _cuts(lengths, directions, long, first, last)
    pieces: list[Piece] = []
    at, heading = xy[0], first
    i = 0
    while i < count:
        if long[i]:
            begin = xy[i] + directions[i] * cuts[i][0]
            finish = xy[i + 1] - directions[i] * cuts[i][1]
            if cuts[i][0] > 0.0:
                pieces.append((_arc_like(at, heading, begin, directions[i]), False))
            pieces.append((_straight(begin, finish), True))
            at, heading = finish, directions[i]
            i += 1
            continue
        j = i
        while j < count and not long[j]:
            j += 1
        toward = directions[j] if j < count else last
        pieces.extend((piece, False) for piece in _fit(xy[i : j + 1], heading, toward))
        at, heading = xy[j], toward
        i = j
    if long[-1] and cuts[-1][1] > 0.0:
        pieces.append((_arc_like(at, heading, xy[-1], last), False))
    return pieces


def _cuts(
    lengths: Array, directions: Array, long: list[bool], first: Array, last: Array
) -> list[tuple[float, float]]:
    """Return how much of each straight is given to the curves at its two ends."""

    def at_end(wanted: Array, i: int) -> float:
        bend = _bend(directions[i], wanted)
        return min(END_BEND_M, 0.45 * lengths[i]) if abs(bend) > _SAME_HEADING else 0.0

    before, after = np.zeros(len(lengths)), np.zeros(len(lengths))
    for i, (a, b) in enumerate(pairwise(range(len(lengths)))):
        if long[a] and long[b]:
            half = abs(_bend(directions[a], directions[b])) / 2.0
            # An arc of tangent length t leaves its corner by t tan(half / 2).
            reach = CORNER_M / max(math.tan(half / 2.0), 1e-6)
            reach = max(reach, 1.0) if half > math.radians(10.0) else reach
            after[i] = before[i + 1] = min(reach, 0.45 * lengths[a], 0.45 * lengths[b])
    if long[0]:
        before[0] = at_end(first, 0)
    if long[-1]:
        after[-1] = at_end(last, -1)
    return list(zip(before.tolist(), after.tolist(), strict=True))


def _bend(a: Array, b: Array) -> float:
    return math.atan2(a[0] * b[1] - a[1] * b[0], float(a @ b))


def _straight(begin: Array, finish: Array) -> Array:
    third = (finish - begin) / 3.0
    return np.array([begin, begin + third, finish - third, finish])


def _arc_like(begin: Array, heading: Array, finish: Array, toward: Array) -> Array:
    """Return the cubic between two poses whose handles are those of a circular arc."""
    span = math.hypot(*(finish - begin))
    angle = min(abs(_bend(heading, toward)), math.radians(170.0))
    handle = span / 3.0
    if angle > 1e-3:
        handle = 2.0 / 3.0 * span * math.tan(angle / 4.0) / math.sin(angle / 2.0)
    return np.array([begin, begin + heading * handle, finish - toward * handle, finish])


def _fit(points: Array, heading: Array, toward: Array) -> list[Array]:
    """Return cubics through points (N, 2) by least squares, halved until they fit.

    Schneider, 1990, An algorithm for automatically fitting digitized curves (Graphics Gems).
    """
    begin, finish = points[0], points[-1]
    if len(points) == 2:
        return [_arc_like(begin, heading, finish, toward)]
    steps = np.hypot(*np.diff(points, axis=0).T)
    t = np.concatenate([[0.0], np.cumsum(steps)]) / steps.sum()
    r = 1.0 - t
    b1, b2 = 3 * r * r * t, 3 * r * t * t
    rest = points - (r**3 + b1)[:, None] * begin - (t**3 + b2)[:, None] * finish
    c11, c12, c22 = b1 @ b1, -float(heading @ toward) * (b1 @ b2), b2 @ b2
    x1, x2 = b1 @ (rest @ heading), -(b2 @ (rest @ toward))
    det = c11 * c22 - c12 * c12
    cubic = _arc_like(begin, heading, finish, toward)
    if det > 1e-9 * c11 * c22:
        h1, h2 = (x1 * c22 - x2 * c12) / det, (c11 * x2 - c12 * x1) / det
        # With handles much longer than an arc's, a cubic runs ahead and comes back.
        usual = math.hypot(*(cubic[1] - begin))
        if 0.2 * usual < min(h1, h2) and max(h1, h2) < 2.0 * usual:
            cubic = np.array([begin, begin + heading * h1, finish - toward * h2, finish])
    on_curve, tangent = _evaluated(cubic, t[:, None])
    gap = points - on_curve
    size = np.maximum(np.hypot(tangent[:, 0], tangent[:, 1]), 1e-9)
    aside = np.abs(cross(tangent, gap)) / size
    if aside.max() <= FIT_M:
        return [cubic]
    middle = int(np.clip(aside.argmax(), 1, len(points) - 2))
    through = unit(points[middle + 1] - points[middle - 1])
    return [*_fit(points[: middle + 1], heading, through), *_fit(points[middle:], through, toward)]


def _evaluated(controls: Array, t: Array) -> tuple[Array, Array]:
    """Return points (..., 2) of cubics (..., 4, 2) at `t` (..., 1), and a third of their slopes."""
    p0, p1, p2, p3 = np.moveaxis(controls, -2, 0)
    r = 1.0 - t
    points = r**3 * p0 + 3 * r * r * t * p1 + 3 * r * t * t * p2 + t**3 * p3
    return points, r * r * (p1 - p0) + 2 * r * t * (p2 - p1) + t * t * (p3 - p2)


def _lengths(controls: Array) -> Array:
    """Return arc lengths (N,) by Gauss's quadrature with 16 nodes."""
    t = 0.5 * (_NODES + 1.0)[None, :, None]
    speed = 3 * _evaluated(controls[:, None], t)[1]
    lengths: Array = 0.5 * (np.hypot(speed[..., 0], speed[..., 1]) * _WEIGHTS).sum(axis=1)
    return lengths
