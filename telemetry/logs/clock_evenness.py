"""Whether one clock runs evenly beside another: drift, leaps and scatter over a drive."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.telemetry.logs.declare.motion import GRID_S

_STRETCH_S, _LEAST_STRETCHES, _LEAST_EVEN = 90.0, 4, 3
"""Fitted on its own; so many tell a drift, and so many that a clock runs evenly."""
_LEAST_LEAP_S, _LEAP_SURE = 0.12, 16.0
"""A leap of that is one; it explains stretches better than a drift by four deviations, squared."""
MOST_DRIFT_PPM = 500.0
"""Quartz drifts by 100 at worst: more is a step that passes for a drift."""


def stretches_of(
    y: Array, x: Array, fitted: Callable[[Array, Array], tuple[float, float] | None]
) -> Array:
    """Return (N, 3): when a stretch is, the offset by it alone, and that one's deviation; in s.

    `fitted` returns offset and deviation of signals (G,) on one grid, None where they do not tell.
    """
    known = np.flatnonzero(np.isfinite(y) & np.isfinite(x))
    most = int(len(known) * GRID_S // _STRETCH_S)
    rows = []
    for stretch in np.array_split(known, max(most, 1)):
        part = slice(int(stretch[0]), int(stretch[-1]) + 1)
        fit = fitted(y[part], x[part])
        if fit is not None:
            rows.append((float(np.mean(stretch)) * GRID_S, *fit))
    return np.array(rows).reshape(-1, 3)


class Leap(NamedTuple):
    """A clock says `by_s` more from between two instants of the first recording on."""

    by_s: float
    before_s: float
    after_s: float


def leap_of(stretches: Array) -> Leap | None:
    """Return where two offsets, one before and one after, explain stretches better than a line.

    A clock that leaps by a little is one that drifts, to who fits no more than that.
    """
    if len(stretches) < _LEAST_STRETCHES:
        return None
    at_s, shift_s, std_s = stretches.T
    weight = std_s**-2.0
    line = np.polynomial.Polynomial.fit(at_s, shift_s, 1, w=np.sqrt(weight))
    by_line = float(np.sum(weight * (shift_s - line(at_s)) ** 2))
    best: tuple[float, float, int] | None = None
    for first in range(1, len(stretches)):
        before, after = (
            float(np.average(shift_s[part], weights=weight[part]))
            for part in (slice(None, first), slice(first, None))
        )
        level = np.where(np.arange(len(stretches)) < first, before, after)
        left = float(np.sum(weight * (shift_s - level) ** 2))
        best = min(best or (math.inf, 0.0, 0), (left, after - before, first))
    assert best is not None
    by_step, by_s, first = best
    scatter = max(by_step / (len(stretches) - 3), 1.0)
    if abs(by_s) < _LEAST_LEAP_S or (by_line - by_step) / scatter < _LEAP_SURE:
        return None
    return Leap(by_s, float(at_s[first - 1]), float(at_s[first]))


def unevenness_s(stretches: Array, drift_ppm: float) -> float:
    """Return the deviation of stretches' offsets from an even clock beyond their own, 0 where there
    are too few: by moments, as DerSimonian and Laird (1986), Meta-analysis in clinical trials."""
    if len(stretches) < _LEAST_EVEN:
        return 0.0
    at_s, shift_s, std_s = stretches.T
    weight = std_s**-2.0
    left = shift_s - drift_ppm * 1e-6 * at_s
    left -= np.average(left, weights=weight)
    beyond = float(np.sum(weight * left**2)) - (len(stretches) - 1)
    whole = float(np.sum(weight))
    return math.sqrt(max(beyond, 0.0) / (whole - float(np.sum(weight**2)) / whole))


def drift_ppm_of(stretches: Array) -> tuple[float, float]:
    """Return in ppm how the offset grows, and the standard deviation of that."""
    if len(stretches) < _LEAST_STRETCHES:
        return 0.0, math.inf
    at_s, shift_s, std_s = stretches.T
    weight = std_s**-2.0
    around = at_s - np.average(at_s, weights=weight)
    spread = float(np.sum(weight * around**2))
    slope = float(np.sum(weight * around * shift_s)) / spread
    left = shift_s - np.average(shift_s, weights=weight) - slope * around
    scatter = max(float(np.sum(weight * left**2)) / (len(stretches) - 2), 1.0)
    return slope * 1e6, math.sqrt(scatter / spread) * 1e6
