"""How far the car will get: quantiles of the distance that it will have travelled, by instant.

Between two quantiles a share grows in a straight line; beyond the outermost ones it falls off
exponentially, as fast as between the two nearest to it.
"""

from __future__ import annotations

import functools

import msgspec
import numpy as np

from foretwin.contracts.arrays import Array

PROGRESS_TIMES_S = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0)
"""Instants of a forecast, from the state that it begins with."""
PROGRESS_LEVELS = tuple(k / 20 for k in range(1, 20))
"""Of its quantiles."""
_SCORED = 100
"""Levels at which a forecast is scored, the middles of as many equal shares: of a normal one the
score is right to 0.01 %."""
LEAST_APART_M = 0.01
"""Two neighbouring quantiles never coincide: a car is not known to a centimetre."""


class ProgressForecast(msgspec.Struct, frozen=True, kw_only=True):
    """Quantiles of the distance travelled along whatever way the car takes.

    `time_s` (T,) from the state that it begins with, `levels` (Q,) rising between 0 and 1,
    `distance_m` (T, Q) rising along Q.
    """

    time_s: Array
    levels: Array
    distance_m: Array

    def at(self, level: float) -> Array:
        """Return (T,) the distance that is not exceeded with this probability."""
        told = np.flatnonzero(self.levels == level)
        if told.size:
            return np.asarray(self.distance_m[:, told[0]])
        shares = np.full((len(self.time_s), 1), level)
        return value_at(self.levels, self.distance_m, shares)[:, 0]

    @property
    def median_m(self) -> Array:
        """(T,) as likely exceeded as not."""
        return self.at(0.5)


class ForecastOutcome(msgspec.Struct, frozen=True, kw_only=True):
    """What came of a round's forecast at one instant, `horizon_s` after it began.

    `share` is the part of the forecast that lay below what came. The CRPS of the forecast, of the
    same before it was calibrated in this drive (`table`), and of the round's futures, all taken as
    equally likely (`futures`; None where none of them is valid).
    """

    round_id: int
    stamp_ns: int
    intersection_id: str
    horizon_s: float
    travelled_m: float
    p10_m: float
    p50_m: float
    p90_m: float
    share: float
    crps_m: float
    crps_table_m: float
    crps_futures_m: float | None


def rising(quantiles_m: Array) -> Array:
    """Return quantiles (T, Q) as distances have them: in order and apart, none below 0, and none
    less than at an instant before."""
    ordered = np.maximum.accumulate(np.maximum(np.sort(quantiles_m, axis=1), 0.0), axis=0)
    spread = LEAST_APART_M * np.arange(quantiles_m.shape[1])
    return np.asarray(np.maximum.accumulate(ordered - spread, axis=1) + spread)


def share_below(levels: Array, quantiles: Array, values: Array) -> Array:
    """Return which share of each of T distributions lies below its values (T, V).

    `levels` (Q,) or (T, Q) rise between 0 and 1, exclusively, and `quantiles` (T, Q) rise.
    """
    levels = np.broadcast_to(levels, quantiles.shape)
    short = np.minimum(values - quantiles[:, :1], 0.0) / _tail(levels, quantiles)[:, None]
    high_tail = _tail(1.0 - levels[:, ::-1], -quantiles[:, ::-1])[:, None]
    far = np.maximum(values - quantiles[:, -1:], 0.0) / high_tail
    between = np.array([*map(np.interp, values, quantiles, levels)]).reshape(values.shape)
    low, high = levels[:, :1] * np.exp(short), 1.0 - (1.0 - levels[:, -1:]) * np.exp(-far)
    return np.select([short < 0.0, far > 0.0], [low, high], between)


def value_at(levels: Array, quantiles: Array, shares: Array) -> Array:
    """Return the value below which `shares` (T, V) of each of T distributions lie.

    Undoes `share_below`; shares lie between 0 and 1, exclusively. Between two levels it is
    np.interp's formula, over all distributions at once.
    """
    levels = np.broadcast_to(levels, quantiles.shape)
    last = levels.shape[1] - 1
    place = (levels[:, None] <= shares[..., None]).sum(axis=2)
    right = np.clip(place, 1, last)
    low, high = (np.take_along_axis(levels, at, 1) for at in (right - 1, right))
    below, above = (np.take_along_axis(quantiles, at, 1) for at in (right - 1, right))
    found = (above - below) / (high - low) * (shares - low) + below
    first, end = levels[:, :1], levels[:, -1:]
    lower = _tail(levels, quantiles)[:, None] * np.log(shares / first)
    upper = _tail(1.0 - levels[:, ::-1], -quantiles[:, ::-1])[:, None]
    upper = upper * np.log((1.0 - shares) / (1.0 - end))
    return np.select(
        [shares < first, shares > end, place > last],
        [quantiles[:, :1] + lower, quantiles[:, -1:] - upper, quantiles[:, -1:]],
        found,
    )


def crps_of(levels: Array, quantiles: Array, values: Array) -> Array:
    """Return the CRPS (T,) of T distributions, told by quantiles (T, Q) at `levels` (Q,), where
    `values` (T,) came, in their unit.

    Twice the mean pinball loss over all levels (Gneiting, Raftery 2007, 4.2), of what lies between
    the quantiles and beyond them too: over those alone it would be 4 to 5 % too large.
    """
    scored, shares = _scored(tuple(levels.tolist()))
    over = values[:, None] - quantiles @ shares
    loss = np.where(over >= 0.0, scored * over, (scored - 1.0) * over)
    return np.asarray(2.0 * loss.mean(axis=1))


@functools.lru_cache(maxsize=8)
def _scored(levels: tuple[float, ...]) -> tuple[Array, Array]:
    """Return the levels to score at (S,), and what of each quantile (Q, S) their values are made.

    `value_at` is linear in the quantiles.
    """
    scored = (np.arange(_SCORED) + 0.5) / _SCORED
    each = np.broadcast_to(scored, (len(levels), _SCORED))
    return scored, value_at(np.array(levels), np.eye(len(levels)), each)


def _tail(level: Array, quantile: Array) -> Array:
    """Return after how much of the value the share below falls by e, at the low end."""
    rise = quantile[..., 1] - quantile[..., 0]
    return np.asarray(rise / np.log(level[..., 1] / level[..., 0]))
