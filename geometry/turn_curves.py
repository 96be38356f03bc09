"""The paths of turns: quintic curves whose curvature goes on from lane to lane without a jump.

Where the lines of both lanes cross ahead, all headings of a curve lie between those of its lanes:
no path goes round in a loop.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.geometry.polyline import Flags, cross, left_of, turn_rad
from foretwin.geometry.polyline_batch import Polylines, without_repeats
from foretwin.geometry.quintic_curves import control_vectors, displacements, motion, turned_rad

LEAST_DRAWN_M = 0.2
"""Tighter turns are no path: a wheel is larger, and the millimetre grid would bend them."""
REACH_PER_RADIUS = 1.18
"""Where both lanes end so many times R tan(turn / 2) before their lines cross, the least radius
is R: the rest is for the curvature to rise and fall."""
MOST_LEFT_RAD = math.radians(25.0)
"""Paths that leave the angle between their lanes farther are taken where there is no other."""
_WANTED_PM, _RATE_M, _LEFT_COST_PM = 0.05, 0.25, 100.0
"""Of paths that bend less than 1/20 m, that counts whose bend changes least; a bend's change over a
quarter of a metre counts as a bend; a radian outside the angle is worse than any bend."""
_TURNED_BACK_RAD = math.radians(178.0)
"""Paths that leave the angle between their lanes farther run back on their own line."""
_STRAIGHT_RAD, _STRAIGHT_M = 0.005, 0.003
_CROSSING_RAD = math.radians(3.0), math.radians(165.0)
"""Only the lines of lanes at such an angle cross at a place of use."""
_PACE = 1.85
"""Speed at the ends of a turn over reach x √cos(turn / 2). By search 1.77 bends least; a little
more lowers the bend's rate by a third."""
_CHORDS = (0.75, 1.1, 1.5, 2.2)
"""Speeds at the ends of other paths over the distance between these."""
_RATED_AT = np.linspace(0.0, 1.0, 13)[1:-1]
_STEP_RAD, _STEP_M = math.radians(6.0), 0.5
_LEAD_M, _LEAD_RAD = 0.4, math.radians(1.0)
"""No farther from its ends, and where it bends by no more, a path has a point each."""
_REPEAT_M = 0.05


class Turns(NamedTuple):
    """Paths from lane to lane; the radius of the tightest bend of each, (K,), and how far its
    heading leaves the angle between its lanes, (K,) in radians.

    A radius of 0 means that there is no room for any: the path is then no more than a chord.
    """

    lines: Polylines
    radius_m: Array
    left_rad: Array


class _LaneEnds(NamedTuple):
    """Where K paths leave and arrive, (K, 2), and the bends of their lanes there, (K,)."""

    start: Array
    heading: Array
    end: Array
    end_heading: Array
    bend_pm: Array
    end_bend_pm: Array


class _Choice(NamedTuple):
    """Straight pieces before and behind a curve, and its speed at both ends, (K,) in metres."""

    before_m: Array
    behind_m: Array
    pace_m: Array

    def where(self, better: Flags, other: _Choice) -> _Choice:
        return _Choice(*(np.where(better, b, a) for a, b in zip(self, other, strict=True)))


class _Rating(NamedTuple):
    cost: Array
    radius_m: Array
    left_rad: Array


def turn_curves(
    start: Array,
    heading: Array,
    end: Array,
    end_heading: Array,
    *,
    bend_pm: Array | None = None,
    end_bend_pm: Array | None = None,
) -> Turns:
    """Return smooth paths from `start` to `end`, tangent to both headings; all are (K, 2).

    `bend_pm` and `end_bend_pm` (K,) are the curvatures of the lanes there, positive to the left,
    none by default. Where the lines of both lanes cross ahead, what one is longer than the other
    is driven straight. Of some choices that which bends least counts, among those that leave the
    angle between their lanes by 25° at most. Ends are kept to the last bit; other points lie on
    the millimetre grid.
    """
    none = np.zeros(len(start))
    bends = (none if bend_pm is None else bend_pm, none if end_bend_pm is None else end_bend_pm)
    ends = _LaneEnds(start, heading, end, end_heading, *bends)
    angle = turn_rad(heading, end_heading)
    best = _Choice(none, none, none)
    rated = _Rating(none + np.inf, none, none)
    for choice in _choices(ends, angle):
        found = _rated(_vectors(ends, choice), angle)
        better = found.cost < rated.cost - 1e-9
        best = best.where(better, choice)
        rated = _Rating(*(np.where(better, b, a) for a, b in zip(rated, found, strict=True)))
    gap = end - start
    in_line = (np.abs(angle) < _STRAIGHT_RAD) & (np.abs(cross(heading, gap)) < _STRAIGHT_M)
    in_line &= (gap * heading).sum(axis=1) > 0.0
    room = (rated.radius_m > LEAST_DRAWN_M) & (rated.left_rad < _TURNED_BACK_RAD)
    radius = np.where(room, rated.radius_m, 0.0)
    return Turns(
        lines=_drawn(ends, best, in_line),
        radius_m=np.where(in_line, np.inf, radius),
        left_rad=np.where(in_line, 0.0, rated.left_rad),
    )


def _choices(ends: _LaneEnds, angle: Array) -> list[_Choice]:
    gap = ends.end - ends.start
    size = np.abs(angle)
    crossing = (size > _CROSSING_RAD[0]) & (size < _CROSSING_RAD[1])
    sin = np.where(crossing, np.sin(angle), 1.0)
    ahead_m, behind_m = cross(gap, ends.end_heading) / sin, cross(ends.heading, gap) / sin
    reach_m = np.minimum(ahead_m, behind_m)
    crossing &= reach_m > LEAST_DRAWN_M
    pace = np.where(crossing, _PACE * reach_m * np.sqrt(np.cos(angle / 2.0)), np.nan)
    # A lane that bends cannot be left straight on.
    straight, end_straight = ends.bend_pm == 0.0, ends.end_bend_pm == 0.0
    before = np.where(straight, ahead_m - reach_m, 0.0)
    behind = np.where(end_straight, behind_m - reach_m, 0.0)
    found = [_Choice(before, behind, pace)]
    # Who turns back drives straight on until, or from where, both ends lie side by side.
    back = size >= _CROSSING_RAD[1]
    along, end_along = (gap * ends.heading).sum(axis=1), (gap * ends.end_heading).sum(axis=1)
    before = np.where(back & straight, np.maximum(along, 0.0), 0.0)
    behind = np.where(back & end_straight, np.maximum(end_along, 0.0), 0.0)
    rest = gap - before[:, None] * ends.heading - behind[:, None] * ends.end_heading
    chord = np.hypot(rest[:, 0], rest[:, 1])
    chord = np.where(chord > LEAST_DRAWN_M, chord, np.nan)
    return found + [_Choice(before, behind, share * chord) for share in _CHORDS]


def _vectors(ends: _LaneEnds, choice: _Choice) -> Array:
    u, v, pace = ends.heading, ends.end_heading, choice.pace_m[:, None]
    gap = ends.end - ends.start - choice.before_m[:, None] * u - choice.behind_m[:, None] * v
    return control_vectors(gap, pace * u, pace * v, ends.bend_pm, ends.end_bend_pm)


def _rated(vectors: Array, angle: Array) -> _Rating:
    """Return how good curves are by some points of each; NaN is infinitely bad."""
    found = motion(vectors, _RATED_AT)
    bend, speed = found.curvature_pm, found.speed
    way_m = (speed[1:] + speed[:-1]) / 2.0 * np.diff(_RATED_AT)[:, None]
    rate = (np.abs(np.diff(bend, axis=0)) / way_m).max(axis=0)
    tightest = np.abs(bend).max(axis=0)
    ways = np.concatenate([vectors[:1], found.velocity, vectors[-1:]])
    yaw = np.cumsum(turn_rad(ways[:-1], ways[1:]), axis=0)
    # Who turns back may do so to either side.
    whole = np.where(np.abs(angle) < _CROSSING_RAD[1], angle, yaw[-1])
    high, low = np.maximum(whole, 0.0), np.minimum(whole, 0.0)
    left = np.maximum(np.maximum(yaw.max(axis=0) - high, low - yaw.min(axis=0)), 0.0)
    cost = np.maximum(tightest, _WANTED_PM) + _RATE_M * rate
    cost += _LEFT_COST_PM * np.maximum(left - MOST_LEFT_RAD, 0.0)
    return _Rating(
        np.where(np.isfinite(cost), cost, np.inf), 1.0 / np.maximum(tightest, 1e-9), left
    )


def _drawn(ends: _LaneEnds, choice: _Choice, in_line: Flags) -> Polylines:
    """Return points of paths: their ends, near these one each, and some along their curves."""
    vectors = _vectors(ends, choice)
    gap = ends.end - ends.start
    length_m = np.hypot(gap[:, 0], gap[:, 1])
    most = np.maximum(np.floor(length_m / _STEP_M), 1.0)
    steps = np.clip(np.ceil(turned_rad(vectors) / _STEP_RAD), 1.0, most)
    steps = np.where(in_line, 1, steps).astype(np.int64)
    # The ends, those of the curve, near these one each, and between them.
    counts = steps + 5
    first = np.concatenate([[0], np.cumsum(counts)])
    head, tail = first[:-1], first[1:] - 1
    which = np.repeat(np.arange(len(counts)), counts)
    at = (np.arange(len(which)) - head[which] - 2) / steps[which]
    at[head + 1], at[tail - 1] = 0.0, 1.0
    begin = ends.start + choice.before_m[:, None] * ends.heading
    finish = ends.end - choice.behind_m[:, None] * ends.end_heading
    xy = begin[which] + displacements(vectors[:, which], np.clip(at, 0.0, 1.0))
    # So near to its ends a curve is all but an arc, or straight.
    near_m = np.minimum(_LEAD_M, 0.5 * choice.pace_m / steps)
    for rows, at_end, side, heading, bend_pm in (
        (head + 2, begin, 1.0, ends.heading, ends.bend_pm),
        (tail - 2, finish, -1.0, ends.end_heading, ends.end_bend_pm),
    ):
        lead_m = np.minimum(near_m, _LEAD_RAD / np.maximum(np.abs(bend_pm), 1e-9))[:, None]
        aside = 0.5 * bend_pm[:, None] * lead_m**2 * left_of(heading)
        xy[rows] = at_end + side * lead_m * heading + aside
    xy = np.round(xy, 3)
    xy[head], xy[tail] = ends.start, ends.end
    keep = ~in_line[which]
    keep[head + 1] &= choice.before_m > _REPEAT_M
    keep[tail - 1] &= choice.behind_m > _REPEAT_M
    keep[head] = keep[tail] = True
    return without_repeats(Polylines(xy, first).keep(keep), tolerance_m=_REPEAT_M)
