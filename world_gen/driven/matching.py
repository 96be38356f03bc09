"""Which lanes and connections a pass went along, and how sure that is."""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from foretwin.contracts.arrays import Array, Flags, Indices
from foretwin.geometry.polyline import cross, densified, tangents
from foretwin.world_gen.driven.passes import STEP_M, Pass

MAP_ERROR_M = 1.2
"""Standard deviation of a lane's place: a way of OpenStreetMap and lane widths by class.
Measured on the Berlin drive: half of the places lie within 0.9 m."""
ALIKE_M = 25.0
"""So far along a road errors of map and receiver are the same: they count once. Chosen."""
CLEAR = 0.9
"""A pass tells nothing where it is less probable than this that it is known along what it went."""
_REACH_M = 5.0
_SAME_WAY_COS = math.cos(math.radians(45.0))
_HEADING_RAD = math.radians(12.0)
_DRAWN_ERRORS = 2.0
"""Paths through junctions are drawn: so many times as far off as lanes, and as much aslant."""
_UNKNOWN_ERRORS = 3.5
"""Farther off than so many standard deviations it is likelier that the car was elsewhere."""
_LANE_CHANGE, _LEFT_ROAD, _NOT_JOINED = -4.0, -3.0, -14.0
"""Logarithms of what changes from one point to the next weigh. Chosen."""
_SPACING_M = 0.5
UNKNOWN = -1


class LaneLine(NamedTuple):
    """A lane or connection: its middle (N, 2), what it leads to, and what lies beside it."""

    xy_m: Array
    next_ids: tuple[str, ...]
    beside_ids: tuple[str, ...]
    drawn: bool
    """No lane of the map, but a path drawn from one to another."""


class PassMatch(NamedTuple):
    """Of each point of a pass: number of its line, or -1, how far left of it, whether sure."""

    line: Indices
    left_m: Array
    clear: Flags


class _Places(NamedTuple):
    line: Indices
    left_m: Array
    weight: Array
    """Logarithm of how well the point fits."""


class Lines:
    """All lines of a World, for matching passes to them."""

    def __init__(self, lines: Mapping[str, LaneLine]) -> None:
        self.ids = tuple(lines)
        number = {key: i for i, key in enumerate(self.ids)}
        dense = [densified(line.xy_m, spacing_m=_SPACING_M) for line in lines.values()]
        self._line = np.repeat(np.arange(len(dense)), [len(xy) for xy in dense])
        self._xy = np.concatenate(dense)
        self._along = np.concatenate([tangents(xy) for xy in dense])
        self._tree = cKDTree(self._xy)
        self._error = np.array([_DRAWN_ERRORS if one.drawn else 1.0 for one in lines.values()])
        self._next = [{number[k] for k in one.next_ids if k in number} for one in lines.values()]
        self._beside = [
            {number[k] for k in one.beside_ids if k in number} for one in lines.values()
        ]

    def match(self, one: Pass) -> PassMatch:
        """Return along what a pass went: the likeliest line at each point, all points weighed.

        Forward and backward probabilities of a hidden Markov model (Rabiner, 1989), with what is
        alike in errors along a road counted once.
        """
        error_m = math.hypot(MAP_ERROR_M, one.std_m)
        points = zip(one.xy_m, one.along, strict=True)
        places = [self._places(xy, along, error_m) for xy, along in points]
        steps = [self._steps(a.line, b.line) for a, b in pairwise(places)]
        forward = [places[0].weight]
        for step, place in zip(steps, places[1:], strict=True):
            forward.append(_log_sum(forward[-1][:, None] + step, 0) + place.weight)
        backward = [np.zeros(len(places[-1].line))]
        for step, place in zip(reversed(steps), reversed(places[1:]), strict=True):
            backward.append(_log_sum(step + (backward[-1] + place.weight)[None, :], 1))
        line, left, clear = [], [], []
        for place, before, behind in zip(places, forward, reversed(backward), strict=True):
            both = before + behind
            share = np.exp(both - _log_sum(both[:, None], 0))
            best = int(np.argmax(share))
            line.append(int(place.line[best]))
            left.append(float(place.left_m[best]))
            clear.append(bool(share[best] >= CLEAR) and place.line[best] != UNKNOWN)
        return PassMatch(np.array(line), np.array(left), np.array(clear))

    def _places(self, xy_m: Array, along: Array, error_m: float) -> _Places:
        rows = np.array(self._tree.query_ball_point(xy_m, _REACH_M), dtype=np.intp)
        cos = self._along[rows] @ along
        gap = xy_m - self._xy[rows]
        d = self._along[rows]
        ahead, left = (gap * d).sum(axis=1), cross(d, gap)
        fits = (np.abs(ahead) <= _SPACING_M) & (cos > _SAME_WAY_COS)
        rows, left, cos, ahead = rows[fits], left[fits], cos[fits], ahead[fits]
        order = np.lexsort((np.abs(ahead), self._line[rows]))
        kept = order[np.unique(self._line[rows[order]], return_index=True)[1]]
        turned = np.arccos(np.clip(cos[kept], -1.0, 1.0)) / _HEADING_RAD
        error = self._error[self._line[rows[kept]]]
        squares = ((left[kept] / error_m) ** 2 + turned**2) / error**2
        share = -0.5 * STEP_M / ALIKE_M
        return _Places(
            np.append(self._line[rows[kept]], UNKNOWN),
            np.append(left[kept], 0.0),
            share * np.append(squares, _UNKNOWN_ERRORS**2),
        )

    def _steps(self, before: Indices, behind: Indices) -> Array:
        """Return (M, K) logarithms of how likely each line is to be followed by each."""
        return np.array([[self._step(a, b) for b in behind.tolist()] for a in before.tolist()])

    def _step(self, a: int, b: int) -> float:
        if a == b:
            return 0.0
        if UNKNOWN in (a, b):
            return _LEFT_ROAD
        after = self._next[a]
        if b in after or any(b in self._next[k] for k in after):
            return 0.0
        if b in self._beside[a]:
            return _LANE_CHANGE
        return _NOT_JOINED


def _log_sum(values: Array, axis: int) -> Array:
    most = values.max(axis=axis, keepdims=True)
    total = np.log(np.exp(values - most).sum(axis=axis)) + most.squeeze(axis)
    return np.asarray(total)
