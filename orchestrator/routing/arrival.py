"""When the car will be at the junctions ahead.

For `FORESEEN_S` the driver goes on as `going_on.py` has it, and is not held up; from there on the
road takes as long as at the usual speed. A car that stands is taken to set off now: nobody knows
when it will, so what is shown says that it waits. Stops at the junctions on the way are not
foreseen, so predictions far ahead tend to be early, which is the safe side for building worlds.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.world import Control
from foretwin.geometry.compiled import IN, OUT, REAL, WHOLE, kernel, types
from foretwin.orchestrator.routing.going_on import (
    FADING_S,
    LEARN_FASTER_S,
    LEARN_SLOWER_S,
    UNHINDERED_S,
    USUAL_SHARE,
    going_on_mps2,
)
from foretwin.orchestrator.routing.junctions_ahead import UpcomingJunction
from foretwin.orchestrator.routing.route import Route
from foretwin.sim_worker.driver_model import CURVE_TIME_S
from foretwin.world_gen.junctions.intersections import Junction

FORESEEN_S = 20.0
SETTLING_S = 1.0
"""Time constant with which what is shown follows what is expected."""
_STEP_S = 0.25
_LEFT = math.exp(-_STEP_S / FADING_S)
_PRESENT = math.sqrt(_LEFT)
"""Of the present acceleration, what a step leaves, and what is left in the middle of the first."""
_MOVING_MPS = 1.5
_LEAST_SPEED_MPS = 2.0
_CREEPING_MPS = 0.3


class Arrival(NamedTuple):
    """A junction ahead and the seconds until the car is expected at its centre."""

    junction: Junction
    distance_m: float
    in_s: float


class BendSpeeds(NamedTuple):
    """What bends allow along the road from a position of the route on, every metre."""

    from_m: float
    speed_mps: Array


STRAIGHT = BendSpeeds(0.0, np.empty(0))


class DrivingPace:
    """Learns which share of the speed limit the driver drives at when nothing is in the way."""

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
        more = min(speed_mps / speed_limit_mps, 1.5) - self.share
        within_s = LEARN_FASTER_S if more > 0.0 else LEARN_SLOWER_S
        self.share += more * -math.expm1(-elapsed_s / within_s)

    def seconds_to(
        self,
        route: Route,
        from_m: float,
        places_m: Sequence[float],
        *,
        acceleration_mps2: float = 0.0,
        bends: BendSpeeds = STRAIGHT,
    ) -> list[float]:
        """Return the expected seconds from a position of the route to later ones, in order."""
        usual = np.maximum(self.share * route.speed_limit_mps, _LEAST_SPEED_MPS)
        places = np.array(places_m, dtype=np.float64)
        found = np.empty(len(places))
        going = from_m, self.speed_mps, acceleration_mps2
        near, s_m, time_s = _foresee(places, route.start_m[1:], usual, *bends, *going, found)
        if far := places[near:].tolist():
            bounds = np.clip(route.start_m, s_m, None)
            bounds[-1] = max(bounds[-1], far[-1])
            arrive = time_s + np.concatenate([[0.0], np.cumsum(np.diff(bounds) / usual)])
            found[near:] = np.interp(far, bounds, arrive)
        return found.tolist()


@kernel(types.Tuple((WHOLE, REAL, REAL)), IN, IN, IN, REAL, IN, REAL, REAL, REAL, OUT)
def _foresee(
    places_m: Array,
    ends_m: Array,
    usual_mps: Array,
    bends_from_m: float,
    bends_mps: Array,
    s_m: float,
    speed: float,
    acceleration_mps2: float,
    found: Array,
) -> tuple[int, float, float]:
    """Fill `found` with the seconds to those of `places_m` (N,), in order, that come within
    `FORESEEN_S`; return how many do, and where the car is then, and when.

    `ends_m` (E,) are those of the route's edges, where `usual_mps` (E,) is driven.
    """
    edge, last, count = 0, len(ends_m) - 1, 0
    time_s, present = 0.0, _PRESENT
    while count < len(places_m) and time_s < FORESEEN_S:
        while edge < last and s_m >= ends_m[edge]:
            edge += 1
        ahead_m = s_m + CURVE_TIME_S * speed - bends_from_m
        bend_mps = math.inf  # where nothing is known
        if 0.0 <= ahead_m < len(bends_mps):
            bend_mps = bends_mps[int(ahead_m)]
        accel = going_on_mps2(
            speed, acceleration_mps2, present, usual_mps[edge], UNHINDERED_S, bend_mps
        )
        faster = max(speed + _STEP_S * accel, _CREEPING_MPS)
        mean_mps = (speed + faster) / 2.0
        while count < len(places_m) and places_m[count] <= s_m + _STEP_S * mean_mps:
            found[count] = time_s + max(places_m[count] - s_m, 0.0) / mean_mps
            count += 1
        s_m, speed, time_s = s_m + _STEP_S * mean_mps, faster, time_s + _STEP_S
        present *= _LEFT
    return count, s_m, time_s


class NextJunction(NamedTuple):
    """What is shown of the junction ahead; `in_s` is None while the car waits."""

    name: str
    in_s: float | None
    distance_m: float
    junction_id: str
    control: Control


class Countdown:
    """The seconds until the next junction as they are shown: steady, and none while a car waits."""

    def __init__(self) -> None:
        self.in_s: float | None = None
        self._junction_id = ""
        self._stamp_ns = 0

    def update(self, stamp_ns: int, next_one: Arrival | None, *, waiting: bool) -> None:
        """Take when the car is expected; another junction, or setting off, begins anew."""
        elapsed_s, self._stamp_ns = (stamp_ns - self._stamp_ns) / 1e9, stamp_ns
        junction_id = "" if next_one is None else next_one.junction.summary.id
        same, self._junction_id = junction_id == self._junction_id, junction_id
        if next_one is None or waiting:
            self.in_s = None
        elif self.in_s is None or not same or elapsed_s < 0.0:
            self.in_s = next_one.in_s
        else:
            left_s = self.in_s - elapsed_s
            share = -math.expm1(-elapsed_s / SETTLING_S)
            self.in_s = max(left_s + share * (next_one.in_s - left_s), 0.0)


def predict_arrivals(
    route: Route,
    s_m: float,
    upcoming: Sequence[UpcomingJunction],
    pace: DrivingPace,
    *,
    acceleration_mps2: float = 0.0,
    bends: BendSpeeds = STRAIGHT,
) -> tuple[Arrival, ...]:
    """Return when the car at `s_m` of `route` is expected at the centres of junctions ahead."""
    seconds = pace.seconds_to(
        route,
        s_m,
        [s_m + ahead.distance_m for ahead in upcoming],
        acceleration_mps2=acceleration_mps2,
        bends=bends,
    )
    return tuple(
        Arrival(ahead.junction, ahead.distance_m, in_s)
        for ahead, in_s in zip(upcoming, seconds, strict=True)
    )
