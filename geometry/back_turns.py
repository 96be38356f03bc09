"""Turns back between lanes too near to one another for one bow: out to the far side, and round."""

from __future__ import annotations

import math

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.geometry.polyline import cross, left_of, turn_rad, units
from foretwin.geometry.polyline_batch import Polylines
from foretwin.geometry.quintic_curves import control_vectors, displacements
from foretwin.geometry.steering import MAX_CURVATURE_PM

_AHEAD_M, _PACE_M, _MIDDLE_PACE_M = 15.0, 12.0, 22.0
"""Of lanes upon each other: how far ahead the middle of the turn lies, and speeds at its end and
there. By search the shortest turn of this kind whose radius is 4 m."""
_PER_GAP = 0.67
"""So much shorter is each for every metre between the lanes."""
_BOW_RAD = math.radians(135.0)
_BOW_RADIUS_M, _BOW_POINTS = 4.5, 8
"""A curve with these corners has a radius of some 4 m."""
_REPEAT_M = 0.1
_AT = np.concatenate([[0.0, 0.03], np.linspace(0.0, 1.0, 16)[1:]])
"""Where points lie on each half, one close to the lane, so that paths leave along it."""


def back_turns(start: Array, heading: Array, end: Array, end_heading: Array) -> Polylines:
    """Return paths that leave `start` (K, 2) along `heading` and come back to `end`, all but
    against it.

    Their radius is 4 m where lanes lie up to 8 m aside of one another, to the left or right;
    lanes upon each other are turned between to the left. What one lane is longer than the other
    is driven straight, and the curvatures of both halves meet where they lead straight across.
    """
    gap = end - start
    before = start + np.maximum((gap * heading).sum(axis=1), 0.0)[:, None] * heading
    behind = end - np.maximum((gap * end_heading).sum(axis=1), 0.0)[:, None] * end_heading
    aside_m = cross(heading, gap)
    side = np.where(aside_m < 0.0, -1.0, 1.0)
    across = side[:, None] * left_of(heading)
    less_m = _PER_GAP * np.abs(aside_m)[:, None]
    pace, middle = _PACE_M - less_m, (_MIDDLE_PACE_M - less_m) * across
    top = before + (_AHEAD_M - less_m) * heading + 0.5 * np.abs(aside_m)[:, None] * across
    none, bend = np.zeros(len(side)), side * MAX_CURVATURE_PM
    out = control_vectors(top - before, pace * heading, middle, none, bend)
    back = control_vectors(behind - top, middle, pace * end_heading, bend, none)
    points = [start[:, None], _points(before, out), _points(top, back, backward=True)[:, 1:]]
    paths = np.round(np.concatenate([*points, end[:, None]], axis=1), 3)
    paths[:, 0], paths[:, -1] = start, end
    count = paths.shape[1]
    lines = Polylines(paths.reshape(-1, 2), np.arange(len(side) + 1) * count)
    # Where no straight piece lies between them, an end stands twice.
    keep = np.ones(paths.shape[:2], dtype=bool)
    for end_row, next_row in ((0, 1), (-1, -2)):
        keep[:, next_row] = np.hypot(*(paths[:, next_row] - paths[:, end_row]).T) > _REPEAT_M
    return lines.keep(keep.ravel())


def _points(start: Array, vectors: Array, *, backward: bool = False) -> Array:
    """Return points (K, M, 2) on curves, dense where they leave their lane, or reach it."""
    at = 1.0 - _AT[::-1] if backward else _AT
    many = np.repeat(vectors, len(at), axis=1)
    found = displacements(many, np.tile(at, len(start)))
    return np.asarray(start[:, None] + found.reshape(len(start), len(at), 2))


def with_bows(line: Array) -> Array:
    """Return a line (N, 2) with a bow beyond each point where it turns back by more than 135°.

    The corners of the bow, but for those next to the line's ends none is left, are for a curve
    that passes between them.
    """
    steps = np.diff(line, axis=0)
    ways, step_m = units(steps), np.hypot(steps[:, 0], steps[:, 1])
    bends = turn_rad(ways[:-1], ways[1:])
    has_room = np.minimum(step_m[:-1], step_m[1:]) > _BOW_RADIUS_M
    sharp = np.nonzero((np.abs(bends) > _BOW_RAD) & has_room)[0]
    # Next to its ends it lies on its lanes.
    sharp = sharp[(sharp > 0) & (sharp < len(bends) - 1)]
    if not len(sharp):
        return line
    side = np.sign(bends[sharp])[:, None]
    ahead = units(ways[sharp] - ways[sharp + 1])
    # From the side away from the turn around the middle to the other.
    at = np.linspace(-0.6 * math.pi, 0.6 * math.pi, _BOW_POINTS)[:, None, None]
    aside = side * left_of(ahead)
    middle = line[sharp + 1] + 2.0 * _BOW_RADIUS_M * ahead
    bows = middle + _BOW_RADIUS_M * (np.cos(at) * ahead + np.sin(at) * aside)
    pieces = np.split(line, sharp + 1)
    joined = [pieces[0]]
    for bow, piece in zip(bows.transpose(1, 0, 2), pieces[1:], strict=True):
        joined += [bow, piece[1:]]
    return np.concatenate(joined)
