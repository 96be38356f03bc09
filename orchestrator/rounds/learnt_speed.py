"""The nominal future's speeds, half by the law of the present drive and half by what was learnt.

The law (`routing/speed_ahead.py`) and the median of the learnt forecast err differently: their mean
is nearer to what comes than the law at every horizon, and at 8 s than either (docs/trust.md). The
weights are equal, so that none was chosen on drives: Bates and Granger (1969), "The combination of
forecasts".
"""

from __future__ import annotations

import functools

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.forecast import ProgressForecast
from foretwin.contracts.futures import SPEED_AHEAD_STEP_S

LEARNT_SHARE = 0.5
_POWERS = (2, 3, 4)
"""Of time, in the distance that speeds are changed by: no other place or speed now, and no jerks
where the quantiles of one instant were learnt apart from those of the next."""


def partly_learnt(speed_ahead_mps: Array, forecast: ProgressForecast) -> Array:
    """Return speeds (K,), `SPEED_AHEAD_STEP_S` apart, moved towards a forecast's median distances.

    Who is foreseen to stand throughout goes on standing: when a light changes nobody has learnt.
    """
    if speed_ahead_mps[1:].max(initial=0.0) == 0.0:
        return speed_ahead_mps
    at_s = SPEED_AHEAD_STEP_S * np.arange(len(speed_ahead_mps))
    steps_m = SPEED_AHEAD_STEP_S * (speed_ahead_mps[1:] + speed_ahead_mps[:-1]) / 2.0
    way_m = np.concatenate([[0.0], np.cumsum(steps_m)])
    within = forecast.time_s <= at_s[-1] + 1e-9
    if within.sum() < len(_POWERS):
        return speed_ahead_mps
    time_s = forecast.time_s[within]
    more_m = forecast.median_m[within] - np.interp(time_s, at_s, way_m)
    shares = (_fitting(tuple(time_s.tolist())) * (more_m / time_s)).sum(axis=1)
    change = sum(c * p * at_s ** (p - 1) for c, p in zip(shares.tolist(), _POWERS, strict=True))
    return np.asarray(np.maximum(speed_ahead_mps + LEARNT_SHARE * change, 0.0))


@functools.lru_cache(maxsize=8)
def _fitting(time_s: tuple[float, ...]) -> Array:
    """Return (3, T) what makes coefficients of mean speeds (T,), by least squares."""
    at = np.array(time_s)[:, None]
    return np.asarray(np.linalg.pinv(at ** (np.array(_POWERS) - 1.0)))
