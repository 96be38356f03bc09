"""Places ahead of a moving car: what a drive knows of them, and when the car came there."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import VehicleState
from foretwin.sim_worker.driver_model import STANDING_MPS
from tests.orchestrator.in_process_drive import LockStep

AHEAD_M = np.arange(2.0, 300.0, 2.0)
LATER_S = (3.0, 4.5, 6.0, 8.0, 10.0, 12.0, 14.0, 17.0)
TOLD_S = (10.0, 5.0)
_EVERY_S = 1.0
_PAST_S = (1.0, 2.0, 4.0, 8.0, 15.0, 30.0)
_BEYOND_M = 40
_FREE_MPS = 40.0
_LONGEST_GAP_S = 1.5


class Told(NamedTuple):
    """Between when and when a place is said to be reached that the law has in `in_s`."""

    in_s: float
    distance_m: float
    early_s: float
    late_s: float


class Moment(NamedTuple):
    """What was known at a state: `law_s` is when the car comes to `AHEAD_M`, by the law."""

    time_s: float
    speed_mps: float
    acceleration_mps2: float
    usual_mps: float
    limit_mps: float
    law_s: Array
    bend_mps: Array
    """What bends allow, every metre from the car on."""
    progress_m: Array
    """(T, Q) the forecast's quantiles."""
    told: tuple[Told, ...]


class Observed(LockStep):
    """A drive that notes, once a second while it moves, what it knows."""

    def _take(self, state: VehicleState | None) -> None:
        if not hasattr(self, "moments"):
            self.moments: list[Moment] = []
        super()._take(state)
        way, forecasts = self.mission.way, self._forecasts
        if state is None or self.mission.state != "following" or way.countdown_s is None:
            return
        time_s = state.stamp_ns * 1e-9
        if self.moments and time_s - self.moments[-1].time_s < _EVERY_S:
            return
        assert forecasts is not None
        if state.speed_mps < STANDING_MPS or forecasts._newest is None:
            return
        bends = way._bends
        law_s = np.array(
            way._pace.seconds_to(
                way._follower.route,
                way.s_m,
                list(way.s_m + AHEAD_M),
                acceleration_mps2=way.acceleration_mps2,
                bends=bends,
            )
        )
        told: list[Told] = []
        for in_s in TOLD_S:
            distance_m = float(np.interp(in_s, law_s, AHEAD_M))
            band = forecasts.arrival_band(distance_m, usual_mps=way.usual_speed_mps)
            if law_s[-1] > in_s and band is not None:
                early_s, late_s = band.around(in_s)
                late_s = math.inf if late_s is None else late_s
                told.append(Told(in_s, distance_m, early_s, late_s))
        from_m = max(int(way.s_m - bends.from_m), 0)
        self.moments.append(
            Moment(
                time_s,
                way._cruise.speed_mps,
                way.acceleration_mps2,
                way.usual_speed_mps,
                way.speed_limit_mps,
                law_s,
                np.minimum(bends.speed_mps[from_m:], _FREE_MPS),
                forecasts._newest.forecast.distance_m,
                tuple(told),
            )
        )


class Place(NamedTuple):
    """A place that the car came to `later_s` after a moment without standing on the way."""

    later_s: float
    law_s: float
    least_mps: float
    """On the way there: what only an oracle knows."""
    last_mps: float
    known: list[float]


class WayDriven(NamedTuple):
    """How far a car had come at N instants, and how fast it was."""

    time_s: Array
    way_m: Array
    speed_mps: Array

    def without_gaps(self, from_s: float, to_s: float) -> bool:
        gaps = np.flatnonzero(np.diff(self.time_s) > _LONGEST_GAP_S)
        return not np.any((self.time_s[gaps + 1] > from_s) & (self.time_s[gaps] < to_s))

    def at_s(self, from_s: float, distance_m: float) -> float | None:
        """Return how long it takes from an instant to so much farther, None where nobody knows."""
        wanted_m = np.interp(from_s, self.time_s, self.way_m) + distance_m
        if wanted_m >= self.way_m[-1]:
            return None
        at = int(np.searchsorted(self.way_m, wanted_m))
        share = (wanted_m - self.way_m[at - 1]) / (self.way_m[at] - self.way_m[at - 1])
        came_s = self.time_s[at - 1] + share * (self.time_s[at] - self.time_s[at - 1])
        return float(came_s - from_s) if self.without_gaps(from_s, came_s) else None


def places(moment: Moment, driven: WayDriven) -> list[Place]:
    """Return where the car was after `LATER_S`, until it stands, or its truth has a gap."""
    found: list[Place] = []
    here_m = np.interp(moment.time_s, driven.time_s, driven.way_m)
    for later_s in LATER_S:
        until_s = moment.time_s + later_s
        on_the_way = (driven.time_s >= moment.time_s) & (driven.time_s <= until_s)
        if until_s > driven.time_s[-1] or not driven.without_gaps(moment.time_s, until_s):
            break
        least_mps = float(driven.speed_mps[on_the_way].min())
        distance_m = float(np.interp(until_s, driven.time_s, driven.way_m) - here_m)
        if least_mps < STANDING_MPS or distance_m > AHEAD_M[-1]:
            break
        law_s = float(np.interp(distance_m, AHEAD_M, moment.law_s))
        last_mps = float(np.interp(until_s, driven.time_s, driven.speed_mps))
        known = known_at(moment, driven, distance_m, law_s)
        found.append(Place(later_s, law_s, least_mps, last_mps, known))
    return found


def known_at(moment: Moment, driven: WayDriven, distance_m: float, law_s: float) -> list[float]:
    """Return all that tells at a moment of when the car will have gone so far."""
    speed, bends = moment.speed_mps, np.append(moment.bend_mps, _FREE_MPS)
    way, beyond = bends[: int(distance_m) + 1], bends[int(distance_m) :][:_BEYOND_M]
    past = np.interp(moment.time_s - np.array(_PAST_S), driven.time_s, driven.speed_mps)
    return [
        distance_m,
        law_s,
        distance_m / max(speed, 1.0),
        speed,
        moment.acceleration_mps2,
        moment.usual_mps,
        moment.limit_mps,
        float(way.min()),
        float(np.sum(1.0 / np.clip(way, 2.0, 15.0))),
        float(beyond.min(initial=_FREE_MPS)),
        *(speed - past).tolist(),
        *moment.progress_m[[3, -1]][:, [4, 9, 17]].ravel().tolist(),
    ]


class Came(NamedTuple):
    """What came of what was told at one place."""

    told: Told
    came_s: float


def what_came(moment: Moment, driven: WayDriven) -> list[Came]:
    """Return when places were reached of which something was told."""
    both = [(told, driven.at_s(moment.time_s, told.distance_m)) for told in moment.told]
    return [Came(told, came_s) for told, came_s in both if came_s is not None]
