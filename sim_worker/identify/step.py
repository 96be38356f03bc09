"""A step in the steering or the tyres: each short stretch of bends told by the car as identified.

With all other parameters held, a single bend tells one of them far better than it tells all. What
it then departs from zero by is compared with what the bends before departed by, with what the
identified parameters leave open there, and with what play in the steering may make of it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from contracts.arrays import Array
from sim_worker.identify.steering import PLAY_RAD, SteeringFit
from sim_worker.identify.steering_signals import (
    INVERSE_RATIO,
    OFFSET,
    TURNING,
    UNDERSTEER,
    SteeringSignals,
)

STRETCH_S, _LEAST_TURNING_S = 2.0, 1.0
_LEAST_STRETCHES = 4
_MUCH_WIDER = 1.5
_STDS = 3.0
"""Twice in a row to the same side: once in 250,000 by chance, were it Gaussian."""
TURNING_MPS2 = 0.5
"""Sideways acceleration from which the car counts as turning."""
_CANDIDATES = (INVERSE_RATIO, OFFSET, UNDERSTEER, TURNING)


class BendsBefore(NamedTuple):
    """The identified parameters (8,), their covariance, and how bends scatter about each (8,)."""

    values: Array
    covariance: Array
    scatter: Array

    def knows_less(self, other: BendsBefore) -> bool:
        """Return whether it leaves much more open of the understeer gradient than another."""
        mine, known = (
            self.covariance[UNDERSTEER, UNDERSTEER],
            other.covariance[UNDERSTEER, UNDERSTEER],
        )
        return bool(mine > (_MUCH_WIDER**2) * known)


class Step(NamedTuple):
    """Which parameter departed, from what to about what."""

    parameter: int
    before: float
    after: float
    sure: bool
    """Whether two stretches of bends say so; one alone may be chance, or the first of two."""
    after_s: float
    """The record's time from which all of the driving was after it."""


class _Stretches(NamedTuple):
    begin_s: Array
    departures: Array
    """Of each parameter (M, 8), all others held."""
    slopes: Array
    """Of these by each parameter (M, 8, 8)."""
    gains: Array
    """How much of the residuals' squares each departure explains (M, 8)."""


def _stretches(signals: SteeringSignals, values: Array) -> _Stretches:
    apart, slopes = signals.unexplained(values)
    time_s = signals.time_s[signals.used]
    period_s = float(signals.time_s[1])
    turns = np.abs(signals.lateral_mps2[signals.used]) > TURNING_MPS2
    number = np.floor(time_s / STRETCH_S).astype(np.int64)
    told = np.bincount(number, weights=turns) * period_s >= _LEAST_TURNING_S
    begins, moments, grams = [], [], []
    for index in np.flatnonzero(told):
        inside = turns & (number == index)
        begins.append(index * STRETCH_S)
        moments.append(slopes[:, inside] @ apart[inside])
        grams.append(slopes[:, inside] @ slopes[:, inside].T)
    count = len(values)
    moment = np.reshape(moments, (-1, count))
    gram = np.reshape(grams, (-1, count, count))
    square = np.maximum(np.diagonal(gram, axis1=1, axis2=2), 1e-300)
    return _Stretches(
        np.array(begins), moment / square, gram / square[:, :, None], np.square(moment) / square
    )


def bends_before(fit: SteeringFit) -> BendsBefore | None:
    """Return how the bends that were fitted scatter; None where they are too few to tell."""
    told = _stretches(fit.signals, fit.fit.values)
    if len(told.begin_s) < _LEAST_STRETCHES:
        return None
    scatter = np.sqrt(np.sum(np.square(told.departures), axis=0) / (len(told.begin_s) - 1))
    return BendsBefore(fit.fit.values, fit.fit.covariance, scatter)


def find_step(signals: SteeringSignals, before: BendsBefore) -> Step | None:
    """Return the step that the newest stretch of bends, or the newest two, tell of, if any."""
    told = _stretches(signals, before.values)
    for count in (2, 1):
        if len(told.begin_s) >= count:
            found = _departed(told, before, count)
            if found is not None:
                return found
    return None


def _departed(told: _Stretches, before: BendsBefore, count: int) -> Step | None:
    departures, slopes = told.departures[-count:], told.slopes[-count:]
    open_std = np.sqrt(np.einsum("mji,ik,mjk->mj", slopes, before.covariance, slopes))
    # However alike bends were: the tyres need not stand as the steering wheel says.
    play_std = np.abs(slopes[:, :, OFFSET] * (PLAY_RAD * before.values[INVERSE_RATIO]))
    apart = departures / np.hypot(np.hypot(before.scatter, open_std), play_std)
    found: Step | None = None
    most = 0.0
    for index in _CANDIDATES:
        sides = apart[:, index]
        same = bool(np.all(sides > _STDS) or np.all(sides < -_STDS))
        explained = math.fsum(told.gains[-count:, index])
        if same and explained > most:
            most = explained
            value = float(before.values[index])
            found = Step(
                parameter=index,
                before=value,
                after=value + float(np.mean(departures[:, index])),
                sure=count > 1,
                after_s=float(told.begin_s[-count]) + STRETCH_S,
            )
    return found
