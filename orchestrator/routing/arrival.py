"""When the car will be at the junctions ahead.

The road ahead takes as long as at the driver's usual share of the speed limits; until then the
car eases from its present speed to that one, and a standing car first waits `DWELL_S` more.
Stops at the junctions on the way are not foreseen, so predictions far ahead tend to be early,
which is the safe side for building worlds.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from foretwin.orchestrator.routing.junctions_ahead import UpcomingJunction
from foretwin.orchestrator.routing.route import Route
from foretwin.sim_worker.driver_model import STANDING_MPS
from foretwin.world_gen.junctions.intersections import Junction

USUAL_SHARE = 0.75
"""Of the speed limit: what is driven in towns, before the driver has shown a share of their own."""
LEARNING_S = 40.0
EASING_S = 4.0
DWELL_S = 5.0
_MOVING_MPS = 1.5
_LEAST_SPEED_MPS = 2.0


class Arrival(NamedTuple):
    """A junction ahead and the seconds until the car is expected at its centre."""

    junction: Junction
    distance_m: float
    in_s: float


class DrivingPace:
    """Learns which share of the speed limit the driver drives at while moving."""

    def __init__(self) -> None:
        self.share = USUAL_SHARE
        self.speed_mps = 0.0
        self._stamp_ns: int | None = None

    def update(self, stamp_ns: int, speed_mps: float, speed_limit_mps: float) -> None:
        """Take a speed and the limit where it was driven."""
        before, self._stamp_ns = self._stamp_ns, stamp_ns
        self.speed_mps = max(0.0, speed_mps)
        if before is None or speed_mps < _MOVING_MPS or speed_limit_mps <= 0.0:
            return
        elapsed_s = min(max((stamp_ns - before) / 1e9, 0.0), 1.0)
        weight = 1.0 - math.exp(-elapsed_s / LEARNING_S)
        self.share += weight * (min(speed_mps / speed_limit_mps, 1.5) - self.share)

    def seconds_for(self, route: Route, from_m: float, to_m: float) -> float:
        """Return the expected time in seconds from one position of the route to a later one."""
        if to_m <= from_m:
            return 0.0
        usual_s = self._usual_seconds(route, from_m, to_m)
        dwell_s = DWELL_S if self.speed_mps < STANDING_MPS else 0.0
        usual_mps = (to_m - from_m) / usual_s
        # Distance after t at a speed that eases from v0 to v: v t - (v - v0) T (1 - exp(-t/T)).
        lost_s = EASING_S * (1.0 - self.speed_mps / usual_mps)
        low, high = 0.0, usual_s + max(0.0, lost_s) + 1.0
        for _ in range(40):
            middle = (low + high) / 2.0
            if middle - lost_s * (1.0 - math.exp(-middle / EASING_S)) < usual_s:
                low = middle
            else:
                high = middle
        return dwell_s + (low + high) / 2.0

    def _usual_seconds(self, route: Route, from_m: float, to_m: float) -> float:
        bounds = np.clip(route.start_m, from_m, to_m)
        bounds[-1] = max(bounds[-1], to_m)
        limits = np.array([directed.edge.speed_limit_mps.value for directed in route.edges])
        speeds = np.maximum(self.share * limits, _LEAST_SPEED_MPS)
        return max(float((np.diff(bounds) / speeds).sum()), 1e-3)


def predict_arrivals(
    route: Route, s_m: float, upcoming: Sequence[UpcomingJunction], pace: DrivingPace
) -> tuple[Arrival, ...]:
    """Return when the car at `s_m` of `route` is expected at the centres of junctions ahead."""
    return tuple(
        Arrival(
            ahead.junction, ahead.distance_m, pace.seconds_for(route, s_m, s_m + ahead.distance_m)
        )
        for ahead in upcoming
    )
