"""From features to quantiles of the distance that the car will travel."""

from __future__ import annotations

import functools
from pathlib import Path

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.errors import UserError
from foretwin.contracts.forecast import PROGRESS_LEVELS, ProgressForecast, rising, value_at
from foretwin.orchestrator.forecast.features import FEATURES
from foretwin.orchestrator.forecast.quantile_trees import QuantileTrees, read_trees

SHIPPED_TABLE = Path(__file__).parent / "progress.npz"
"""Learnt from public drives; `progress.LICENSE.txt` says which, and under which licence."""


def distance_m(accel_mps2: Array, speed_mps: Array | float, time_s: Array) -> Array:
    """Return the distance (T, L) after `time_s` (T,) with a mean acceleration (T, L).

    Trees tell v t + a t² / 2 by its a: of one size at all instants, and 0 for a steady speed.
    """
    t = time_s[:, None]
    return np.asarray(np.maximum(speed_mps * t + 0.5 * accel_mps2 * t * t, 0.0))


class ProgressModel:
    """Forecasts from one table."""

    def __init__(self, table: QuantileTrees, *, where: str = "table") -> None:
        """Raise UserError for a table that wants to know what nobody tells it."""
        unknown = [name for name in table.features if name not in FEATURES]
        if unknown:
            raise UserError(
                f"{where}: was learnt from {unknown[0]!r}, which this foretwin does not know; "
                f"known: {', '.join(FEATURES)}"
            )
        self.table = table
        self.time_s = table.time_s
        self._depth = table.depth
        self._places = np.array([FEATURES.index(name) for name in table.features])
        self._time_place = FEATURES.index("time_s")
        self._speed_place = FEATURES.index("speed_mps")

    def forecast(self, features: Array) -> ProgressForecast:
        """Return the forecast from features (F,), as the drives it was learnt from have it."""
        rows = np.repeat(features[None], len(self.time_s), axis=0)
        rows[:, self._time_place] = self.time_s
        accel = self.table.values(rows[:, self._places], self._depth)
        told = rising(distance_m(accel, float(features[self._speed_place]), self.time_s))
        levels = np.broadcast_to(PROGRESS_LEVELS, (len(self.time_s), len(PROGRESS_LEVELS)))
        quantiles = value_at(self.table.shares, told, levels)
        return ProgressForecast(
            time_s=self.time_s,
            levels=np.array(PROGRESS_LEVELS),
            distance_m=rising(quantiles),
        )


def progress_of(setting: str | None) -> ProgressModel | None:
    """Return the model that a setting means: a file's, none for `off`, else the shipped one.

    Raises UserError for a file that cannot be used.
    """
    return None if setting == "off" else progress_model(None if setting is None else Path(setting))


@functools.cache
def progress_model(file: Path | None = None) -> ProgressModel:
    """Return the model of a table's file, or of the shipped one; raises UserError."""
    file = SHIPPED_TABLE if file is None else file
    return ProgressModel(read_trees(file), where=str(file))
