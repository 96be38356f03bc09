"""Widens a forecast by what the car does not know of its own speed.

A drive calibrates by what it measures itself, and a speed that is a little off is off in what it
then measures, too: nothing that calibration could see. So the error that the state says of its
speed is laid over the calibrated forecast.
"""

from __future__ import annotations

import functools
from statistics import NormalDist

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.forecast import ProgressForecast, rising

SPEED_ERROR_LASTS_S = 1.0
"""An error of speed fades by 1/e in so long. Chosen: with it the distance travelled is off as the
state says on drives whose speed is no better than their receiver (tests/trust/progress.py)."""


def distance_std_m(time_s: Array, speed_std_mps: float) -> Array:
    """Return (T,) how far the distance travelled by `time_s` (T,) is off, a standard deviation.

    The integral of an Ornstein-Uhlenbeck process: √(2 τ² (t/τ - 1 + e^(-t/τ))) as
    much as the speed.
    """
    lasts = time_s / SPEED_ERROR_LASTS_S
    parts = np.sqrt(2.0 * (lasts + np.expm1(-lasts)))
    return np.asarray(SPEED_ERROR_LASTS_S * speed_std_mps * parts)


def with_own_error(forecast: ProgressForecast, speed_std_mps: float) -> ProgressForecast:
    """Return a forecast whose quantiles lie as far from the median as both errors together put
    them: squares add up, as of normal errors that know nothing of each other."""
    if not speed_std_mps:
        return forecast
    normal = _normal_at(tuple(forecast.levels.tolist()))
    own_m = normal * distance_std_m(forecast.time_s, speed_std_mps)[:, None]
    median_m = forecast.median_m[:, None]
    aside_m = forecast.distance_m - median_m
    wider_m = median_m + np.sign(normal) * np.hypot(aside_m, own_m)
    return ProgressForecast(
        time_s=forecast.time_s, levels=forecast.levels, distance_m=rising(wider_m)
    )


@functools.lru_cache(maxsize=8)
def _normal_at(levels: tuple[float, ...]) -> Array:
    """Return (Q,) the standard normal's quantiles."""
    return np.array([NormalDist().inv_cdf(level) for level in levels])
