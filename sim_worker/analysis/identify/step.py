"""A step in the steering or the tyres: each short stretch of bends told by the car as identified.

With all other parameters held, a single bend tells one of them far better than it tells all. What
it then departs from zero by is compared with what the bends before departed by, with what the
identified parameters leave open there, and with what play in the steering may make of it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.sim_worker.analysis.identify.acceptance import MUCH_WIDER
from foretwin.sim_worker.analysis.identify.steering import PLAY_RAD, SteeringFit
from foretwin.sim_worker.analysis.identify.steering_signals import SteeringSignals, Theta

STRETCH_S, _LEAST_TURNING_S = 2.0, 1.0
_LEAST_STRETCHES = 4
_STDS = 3.0
"""Twice in a row to the same side: once in 250,000 by chance, were it Gaussian."""
_SEEN_STDS, _TOGETHER_STDS = 2.0, 4.5
"""Tyres that grow softer alike on both axles show where a bend begins or ends, in one stretch of
it alone: two of those that tell, one bend apart or more, must say so."""
_TELLS = 1.0 / 5.0
"""A stretch tells how readily the car turns in if it leaves no more of that open than this."""
_LOADED_S2PM = 0.0005
"""By so much more, rad per m/s² for each m/s², may the understeer gradient differ while the car is
driven or braked, as a standard deviation: the stand-in's goes by as much, at 20 to 28 m/s."""
TURNING_MPS2 = 0.5
"""Sideways acceleration from which the car counts as turning."""
_CANDIDATES = (Theta.INVERSE_RATIO, Theta.OFFSET, Theta.UNDERSTEER, Theta.TURNING)


class BendsBefore(NamedTuple):
    """The identified parameters (8,), their covariance, and what they left unexplained (8,).

    `noise` over the root of what a stretch's slopes come to is how its departures scatter: bends
    that tell little of a parameter depart from it far.
    """

    values: Array
    covariance: Array
    noise: Array

    def knows_less(self, other: BendsBefore) -> bool:
        """Return whether it leaves much more open of the understeer gradient than another."""
        mine, known = (
            self.covariance[Theta.UNDERSTEER, Theta.UNDERSTEER],
            other.covariance[Theta.UNDERSTEER, Theta.UNDERSTEER],
        )
        return bool(mine > (MUCH_WIDER**2) * known)


class Step(NamedTuple):
    """Which parameter departed, from what to about what."""

    parameter: Theta
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
    squares: Array
    """How much each departure is told by (M, 8): times its square, what it explains."""
    gaining_mps2: Array
    """How much the car sped up or slowed down in each (M,), root mean square."""

    def explained(self) -> Array:
        """Return how much of the residuals' squares each departure explains (M, 8)."""
        return np.asarray(np.square(self.departures) * self.squares)


def _stretches(signals: SteeringSignals, values: Array) -> _Stretches:
    apart, slopes = signals.unexplained(values)
    # What is unexplained grows with speed and braking: unweighed, fast bends speak too surely.
    weights = signals.weights()
    apart, slopes = apart * weights, slopes * weights
    time_s = signals.time_s[signals.used]
    period_s = float(signals.time_s[1])
    turns = np.abs(signals.lateral_mps2[signals.used]) > TURNING_MPS2
    number = np.floor(time_s / STRETCH_S).astype(np.int64)
    bends = np.bincount(number, weights=turns) * period_s >= _LEAST_TURNING_S
    gained = np.square(signals.gaining_mps2())
    begins, moments, grams, gains = [], [], [], []
    for index in np.flatnonzero(bends):
        inside = turns & (number == index)
        begins.append(index * STRETCH_S)
        moments.append(slopes[:, inside] @ apart[inside])
        grams.append(slopes[:, inside] @ slopes[:, inside].T)
        gains.append(float(np.mean(gained[inside])) ** 0.5)
    count = len(values)
    moment = np.reshape(moments, (-1, count))
    gram = np.reshape(grams, (-1, count, count))
    squares = np.maximum(np.diagonal(gram, axis1=1, axis2=2), 1e-300)
    slopes_of = gram / squares[:, :, None]
    return _Stretches(np.array(begins), moment / squares, slopes_of, squares, np.array(gains))


def bends_before(fit: SteeringFit) -> BendsBefore | None:
    """Return how the bends that were fitted scatter; None where they are too few to tell."""
    bends = _stretches(fit.signals, fit.fit.values)
    if len(bends.begin_s) < _LEAST_STRETCHES:
        return None
    noise = np.sqrt(np.sum(bends.explained(), axis=0) / (len(bends.begin_s) - 1))
    return BendsBefore(fit.fit.values, fit.fit.covariance, noise)


def find_step(signals: SteeringSignals, before: BendsBefore) -> Step | None:
    """Return the step that the newest stretch of bends, or the newest two, tell of, if any."""
    bends = _stretches(signals, before.values)
    stds = _stds(bends, before)
    sides = bends.departures / stds
    newest = np.arange(len(bends.begin_s))
    for count in (2, 1):
        departed = np.all(np.abs(sides[-count:]) > _STDS, axis=0)
        departed &= np.abs(np.sum(np.sign(sides[-count:]), axis=0)) == count
        if len(newest) >= count and (found := _step(bends, before, newest[-count:], departed)):
            return found
        if found := _softened(bends, before, stds, count):
            return found
    return None


def _stds(bends: _Stretches, before: BendsBefore) -> Array:
    """Return how far each departure may be from zero without a step (M, 8)."""
    open_std = np.sqrt(np.einsum("mji,ik,mjk->mj", bends.slopes, before.covariance, bends.slopes))
    # However alike bends were: the tyres need not stand as the steering wheel says.
    play_std = np.abs(
        bends.slopes[:, :, Theta.OFFSET] * (PLAY_RAD * before.values[Theta.INVERSE_RATIO])
    )
    # Brakes load the front tyres and relieve the rear ones, which are the less stiff for it.
    loaded_std = np.abs(bends.slopes[:, :, Theta.UNDERSTEER]) * (
        _LOADED_S2PM * bends.gaining_mps2[:, None]
    )
    # Where a bend begins and where it ends, this has one sign and the tyres' softness two.
    loaded_std[:, Theta.TURNING] = 0.0
    noise_std = before.noise / np.sqrt(bends.squares)
    return np.asarray(np.sqrt(sum(np.square((noise_std, open_std, play_std, loaded_std)))))


def _softened(bends: _Stretches, before: BendsBefore, stds: Array, count: int) -> Step | None:
    """Return the step in how readily the car turns in that the newest two that tell speak of.

    With `count` 1, that either of them speaks of.
    """
    tells = np.flatnonzero(stds[:, Theta.TURNING] < _TELLS * before.values[Theta.TURNING])[-2:]
    sides = bends.departures[tells, Theta.TURNING] / stds[tells, Theta.TURNING]
    if count == 1:
        tells, sides = tells[np.abs(sides) > _STDS][-1:], sides[np.abs(sides) > _STDS][-1:]
    elif np.any(np.abs(sides) < _SEEN_STDS) or abs(float(sides.sum())) < 2.0**0.5 * _TOGETHER_STDS:
        return None
    if len(tells) < count:
        return None
    found = _step(bends, before, tells, np.ones(len(before.values), dtype=np.bool_))
    return found if found is not None and found.parameter == Theta.TURNING else None


def _step(
    bends: _Stretches, before: BendsBefore, which: np.ndarray, departed: np.ndarray
) -> Step | None:
    """Return the step of the parameter that explains most, of those that `departed` (8,)."""
    explained = np.sum(bends.explained()[which], axis=0)
    candidates = [index for index in _CANDIDATES if departed[index]]
    if not candidates:
        return None
    most = max(candidates, key=lambda index: float(explained[index]))
    value = float(before.values[most])
    return Step(
        parameter=most,
        before=value,
        after=value + float(np.mean(bends.departures[which, most])),
        sure=len(which) > 1,
        after_s=float(bends.begin_s[which[0]]) + STRETCH_S,
    )
