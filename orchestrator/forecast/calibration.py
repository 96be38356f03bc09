"""Calibrates forecasts by what came of the ones before, in the same drive.

Each forecast whose instant has come gives the share of it that lay below what then came. Where
these shares are not evenly spread, the next forecasts' levels are moved accordingly: distributional
conformal prediction (Chernozhukov, Wüthrich, Zhu 2021, doi.org/10.1073/pnas.2107794118), with
weights that fade with the age of what came (Barber, Candès, Ramdas, Tibshirani 2023,
doi.org/10.1214/23-AOS2276), since a drive is no fair sample of itself. A function of drive time and
of the rounds given, in their order.
"""

from __future__ import annotations

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.forecast import ProgressForecast, rising, share_below, value_at

HALF_LIFE_S = 240.0
"""After so much of the drive what came counts half."""
PRIOR_ROUNDS_PER_S = 10.0
"""The table counts as much as so many rounds for each second that a forecast reaches: rounds of
2 Hz whose seconds overlap tell about the same."""
MOST_BACK_S = 1.0
"""Stamps of a live car come a little out of order; a clock that steps back starts another drive."""
LEAST_SHARE = 1e-9
"""So far out even a table that is much too sure of itself has what came."""
_GRID = 1.0 / (1.0 + np.exp(-np.linspace(-20.8, 20.8, 417)))
"""Shares at which levels are moved: fine where tails are."""


class Calibration:
    """What came of forecasts so far, by instant; what it holds may be copied and goes on."""

    def __init__(self, time_s: Array) -> None:
        """Take the instants (T,) of the forecasts to come."""
        self._prior = PRIOR_ROUNDS_PER_S * time_s[:, None]
        self._came = np.zeros((len(time_s), len(_GRID) + 1))
        """Weights of what came up to each place of the grid, from the one before it, as of `_at_s`;
        last, of what came beyond."""
        self._at_s: float | None = None

    def take(self, instant: int, drive_time_s: float, share: float) -> None:
        """Count which share of a forecast lay below what came; not the calibrated one's.

        Where time steps back by more than a second, what was before is forgotten.
        """
        self._fade(drive_time_s)
        share = min(max(share, LEAST_SHARE), 1.0 - LEAST_SHARE)
        self._came[instant, np.searchsorted(_GRID, share)] += 1.0

    def _fade(self, drive_time_s: float) -> None:
        if self._at_s is not None:
            passed_s = drive_time_s - self._at_s
            if -MOST_BACK_S <= passed_s < 0.0:
                return
            self._came *= 0.0 if passed_s < 0.0 else 0.5 ** (passed_s / HALF_LIFE_S)
        self._at_s = drive_time_s

    def calibrated(self, forecast: ProgressForecast) -> ProgressForecast:
        """Return a forecast as what came so far has it; without anything yet, as it was."""
        if not self._came.any():
            return forecast
        levels = np.array(forecast.levels)
        below = np.cumsum(self._came, axis=1)[:, :-1]
        spread = self._prior * _GRID + below
        spread /= self._prior + self._came.sum(axis=1, keepdims=True)
        shares = np.stack([np.interp(levels, row, _GRID) for row in spread])
        np.clip(shares, LEAST_SHARE, 1.0 - LEAST_SHARE, out=shares)
        moved = value_at(levels, forecast.distance_m, shares)
        return ProgressForecast(time_s=forecast.time_s, levels=levels, distance_m=rising(moved))


def shares_of(forecast: ProgressForecast, distance_m: Array) -> Array:
    """Return (T, V) which shares of a forecast lie below distances (T, V)."""
    return share_below(np.array(forecast.levels), forecast.distance_m, distance_m)
