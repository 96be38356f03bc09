"""Borders whose direction Lanelet2's reader takes as it is meant.

The file does not say in which direction a lanelet's ways run: the reader turns a way around where
the middle point of the other one lies on its wrong side. On tight turns that test goes wrong;
another point in the middle, on the same line, lets it come out right.
"""

from __future__ import annotations

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.geometry.polyline import arc_lengths, left_of, points_at, unit, without_repeats
from foretwin.world_gen.export.lane_borders import Borders
from foretwin.world_gen.export.parallels import filled

_SHARES = (0.35, 0.65, 0.2, 0.8, 0.1, 0.9, 0.04, 0.96)
"""Where else on a line its middle point may lie, as shares of its length."""
_COINCIDENT_M = 5e-4
_SWING_M = 3.0
"""How far a line swings out where the map turns a lane around on the spot."""


def read_as_drawn(borders: Borders) -> bool:
    """Return whether Lanelet2 takes both ways in the direction in which they are drawn."""
    left, right = (without_repeats(line, tolerance_m=_COINCIDENT_M) for line in borders)
    if len(left) > 1 and _is_left(left, _middle(right)):
        return False
    return len(right) < 2 or _is_left(right, _middle(left))


def oriented(borders: Borders) -> Borders:
    """Return the borders, redrawn where Lanelet2 would turn one of them around.

    Where lanes lie over each other so that nothing helps they stay as they are.
    """
    if read_as_drawn(borders):
        return borders
    lefts, rights = _variants(borders.left), _variants(borders.right)
    tries = sorted(
        ((i + j, Borders(a, b)) for i, a in enumerate(lefts) for j, b in enumerate(rights)),
        key=lambda found: found[0],
    )
    return next((found for _, found in tries if read_as_drawn(found)), borders)


def _variants(line: Array) -> list[Array]:
    """Return the line with other middle points, a straight one instead, and one that swings out."""
    straight = line[[0, -1]]
    along = unit(straight[1] - straight[0]) * _SWING_M
    out, middle = left_of(along), straight.mean(axis=0)
    swings = [side + shift for shift in (0.0 * along, along, -along) for side in (out, -out)]
    return [
        line,
        *(_with_middle(line, share) for share in _SHARES),
        straight,
        *(_with_middle(straight, share) for share in _SHARES),
        *(np.round([straight[0], middle + way, straight[1]], 3) for way in swings),
    ]


def _middle(line: Array) -> Array:
    middle: Array = line[len(line) // 2] if len(line) > 2 else (line[0] + line[-1]) / 2
    return middle


def _with_middle(line: Array, share: float) -> Array:
    """Return the line with a point at a share of its length and as many before as after it."""
    s = arc_lengths(line)
    if s[-1] < 0.05:
        return line
    at = share * s[-1]
    where = np.round(points_at(line, at), 3)
    near = 0.1 * min(at, s[-1] - at)
    before = np.concatenate([line[s < at - near], where[None]])
    after = np.concatenate([where[None], line[s > at + near]])
    count = max(len(before), len(after))
    halves = filled(before, count)[:-1], filled(after, count)
    joined: Array = np.concatenate(halves)
    return np.round(joined, 3)


def _is_left(line: Array, point: Array) -> bool:
    """Return whether a point lies to the left of a line, as Lanelet2 decides it."""
    a, d = line[:-1], np.diff(line, axis=0)
    share = np.clip(((point - a) * d).sum(axis=1) / (d * d).sum(axis=1), 0.0, 1.0)
    gap = a + share[:, None] * d - point
    i = int(np.argmin((gap * gap).sum(axis=1)))
    left = _turns_left(line[i], line[i + 1], point)
    if share[i] == 1.0 and i + 2 < len(line):
        ahead = line[i + 2]
        if left != _turns_left(line[i + 1], ahead, point) and left == _turns_left(
            line[i], line[i + 1], ahead
        ):
            return not left
    return left


def _turns_left(a: Array, b: Array, c: Array) -> bool:
    (ux, uy), (vx, vy) = (b - a).tolist(), (c - a).tolist()
    return bool(ux * vy - uy * vx > 0.0)
