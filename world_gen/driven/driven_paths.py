"""Connections along the paths that were driven through them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.linalg

from foretwin.contracts.arrays import Array
from foretwin.geometry.polyline import cross, left_of, length, points_at, tangents, turn_rad
from foretwin.geometry.steering import LEAST_GRID_RADIUS_M

_SPACING_M = 0.5
_SMOOTH_M = (1.5, 3.0, 6.0)
"""Shorter waves of a pass are the receiver's; longer ones too where no car could keep to it."""
_MOST_AWAY_M = 5.0
"""A pass that lies farther off went another way."""
_MOST_TURNED_RAD = np.radians(30.0)
"""So much more than its ends ask for a path may turn."""
_UNSEEN = 0.01
"""How much less than a pass it counts that a path was drawn where it was."""


def driven_path(drawn: Array, passes: Sequence[Array]) -> Array | None:
    """Return a connection's path (N, 2) as it was driven, or None where no car could keep to it.

    `drawn` is the path that was drawn, whose ends and directions there stay; `passes` are pieces
    of passes along it. How far aside they went is smoothed by a spline: least bend, and least
    distance from their mean.
    """
    length_m = length(drawn)
    count = max(round(length_m / _SPACING_M), 6)
    line = points_at(drawn, np.linspace(0.0, length_m, count + 1))
    along = tangents(line)
    aside = np.array([_aside_m(line, along, one) for one in passes])
    seen = ~np.isnan(aside)
    if not seen.any():
        return None
    weight = seen.sum(axis=0) + _UNSEEN
    wanted = np.where(seen, aside, 0.0).sum(axis=0) / np.maximum(seen.sum(axis=0), 1)
    wanted[[0, 1, -2, -1]] = 0.0
    for smooth_m in _SMOOTH_M:
        shift = _smooth(wanted[:, None], weight, smooth_m * count / length_m)
        # What was drawn has corners between its points: they are no bends of the path.
        path = _smooth(line + shift * left_of(along), np.ones(count + 1), count / length_m)
        path[1:-1] = np.round(path[1:-1], 3)
        if _drivable(path, drawn):
            return path
    return None


def _aside_m(line: Array, along: Array, one: Array) -> Array:
    """Return (N,) how far left of each point a pass crosses the line square to the path there."""
    into = one[None, :, :] - line[:, None, :]
    ahead = (into * along[:, None, :]).sum(axis=2)
    left = cross(along[:, None, :], into)
    found = np.full(len(line), np.nan)
    crosses = (ahead[:, :-1] <= 0.0) & (ahead[:, 1:] > 0.0)
    for i, j in zip(*np.nonzero(crosses), strict=True):
        share = -ahead[i, j] / (ahead[i, j + 1] - ahead[i, j])
        value = left[i, j] + share * (left[i, j + 1] - left[i, j])
        if abs(value) < _MOST_AWAY_M and not abs(value) > abs(found[i]):
            found[i] = value
    return found


def _smooth(wanted: Array, weight: Array, steps: float) -> Array:
    """Return the values (N, K) nearest to those wanted that bend least; two at each end stay.

    Waves shorter than about six times `steps` are smoothed away.
    """
    n = len(wanted)
    second = np.zeros((n - 2, n))
    rows = np.arange(n - 2)
    second[rows, rows], second[rows, rows + 1], second[rows, rows + 2] = 1.0, -2.0, 1.0
    energy = np.diag(weight) + steps**4 * second.T @ second
    free, held = slice(2, n - 2), [0, 1, n - 2, n - 1]
    side = weight[free, None] * wanted[free] - energy[free][:, held] @ wanted[held]
    found = wanted.copy()
    found[free] = scipy.linalg.solve(energy[free, free], side, assume_a="pos")
    return found


def _drivable(path: Array, drawn: Array) -> bool:
    step = np.diff(path, axis=0)
    length_m = np.hypot(*step.T)
    if (step[1:] * step[:-1]).sum(axis=1).min() <= 0.0 or length_m.min() < 1e-3:
        return False
    turned = turn_rad(step[:-1], step[1:])
    bend = np.abs(turned) / ((length_m[:-1] + length_m[1:]) / 2.0)
    ends = abs(float(turn_rad(drawn[1] - drawn[0], drawn[-1] - drawn[-2])))
    return bool(
        bend.max() < 1.0 / (LEAST_GRID_RADIUS_M) and np.abs(turned).sum() < ends + _MOST_TURNED_RAD
    )
