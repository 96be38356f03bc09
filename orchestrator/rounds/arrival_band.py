"""Between when and when the car will be somewhere ahead: p10 and p90 of its arrival.

Whoever is somewhere by an instant has got at least so far by then: the quantiles of the distance
travelled, read the other way round. Beyond the last instant that a forecast has, an early car comes
back to its usual speed, and a late one goes on as it did at last, its slowing down fading: a car
that then stands comes at a time that nobody knows.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.forecast import ProgressForecast
from foretwin.orchestrator.routing.going_on import FADING_S, USUAL_S

EARLY_LEVEL, LATE_LEVEL = 0.9, 0.1
"""Of the distance travelled: who gets so far comes so early, or so late."""
LATEST_S = 60.0
"""Arrivals that are farther ahead are not told."""
_STEP_S = 0.25


class ArrivalBand(NamedTuple):
    """Seconds until one of ten arrives, and until nine of ten have, None where that cannot be told:
    one of ten may stand on the way."""

    early_s: float
    late_s: float | None

    def around(self, in_s: float) -> ArrivalBand:
        """Return it wide enough for what is shown beside it, which supposes that nothing holds the
        car up."""
        late_s = None if self.late_s is None else max(self.late_s, in_s)
        return ArrivalBand(min(self.early_s, in_s), late_s)


def arrival_band(
    forecast: ProgressForecast, distance_m: float, *, usual_mps: float
) -> ArrivalBand | None:
    """Return when the car will have gone `distance_m` from where the forecast begins.

    `usual_mps` is what the driver usually drives. None where that is too far to tell.
    """
    way = _QuantileWay(forecast, EARLY_LEVEL)
    early_s = way.at_s(distance_m, towards_mps=usual_mps, within_s=USUAL_S)
    if early_s is None:
        return None
    way = _QuantileWay(forecast, LATE_LEVEL)
    rolling_mps = way.speed_mps + FADING_S * way.trend_mps2
    return ArrivalBand(early_s, way.at_s(distance_m, towards_mps=rolling_mps, within_s=FADING_S))


class _QuantileWay:
    """A quantile of the distance travelled over time, and its speed and that speed's trend as the
    forecast ends."""

    def __init__(self, forecast: ProgressForecast, level: float) -> None:
        self.time_s: Array = np.concatenate([[0.0], forecast.time_s])
        self.way_m: Array = np.concatenate([[0.0], forecast.at(level)])
        steps_s = np.diff(self.time_s)
        self.speed_mps = float((self.way_m[-1] - self.way_m[-2]) / steps_s[-1])
        quarters = self.time_s[-1] * np.array([0.25, 0.5, 0.75, 1.0])
        first, half, third, last = np.interp(quarters, self.time_s, self.way_m).tolist()
        self.trend_mps2 = 8.0 * ((last - third) - (half - first)) / float(self.time_s[-1]) ** 2

    def at_s(self, distance_m: float, *, towards_mps: float, within_s: float) -> float | None:
        """Return when it comes to a distance, its speed going from the last one to another."""
        after_s = np.arange(0.0, LATEST_S - self.time_s[-1] + _STEP_S, _STEP_S)
        speed = towards_mps + (self.speed_mps - towards_mps) * np.exp(-after_s / within_s)
        speed = np.maximum(speed, 0.0)
        further = np.cumsum(0.5 * _STEP_S * (speed[1:] + speed[:-1]))
        way_m = np.concatenate([self.way_m, self.way_m[-1] + further])
        if distance_m > way_m[-1]:
            return None
        time_s = np.concatenate([self.time_s, self.time_s[-1] + after_s[1:]])
        place = int(np.searchsorted(way_m, distance_m))
        if place == 0:
            return 0.0
        share = (distance_m - way_m[place - 1]) / (way_m[place] - way_m[place - 1])
        return float(time_s[place - 1] + share * (time_s[place] - time_s[place - 1]))
