"""Forecasts of the car's progress: one for each round, and what came of those of complete ones."""

from __future__ import annotations

import heapq
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import VehicleState
from foretwin.contracts.forecast import (
    ForecastOutcome,
    ProgressForecast,
    crps_of,
    share_below,
)
from foretwin.contracts.frames import LocalFrame, local_from_geo
from foretwin.contracts.futures import CAR_WITHIN_M, SeenRoadUser
from foretwin.contracts.trace import traced
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.orchestrator.forecast.calibration import Calibration
from foretwin.orchestrator.forecast.features import (
    CONTROLS,
    AheadFacts,
    bends_ahead,
    feature_row,
    lead_on,
)
from foretwin.orchestrator.forecast.motion_history import MotionHistory, MotionMoment
from foretwin.orchestrator.forecast.own_error import with_own_error
from foretwin.orchestrator.forecast.progress_model import ProgressModel
from foretwin.orchestrator.instructions import RoundIntent
from foretwin.orchestrator.rounds.arrival_band import ArrivalBand, arrival_band
from foretwin.orchestrator.runner.open_rounds import RoundDone
from foretwin.sim_worker.driver_model import STANDING_MPS
from foretwin.sim_worker.futures.likelihood import travelled_m

TOLD_FOR_S = 2.0
"""An older forecast tells no arrival any more: where no rounds are run nothing is forecast."""


class _NewestForecast(NamedTuple):
    """The newest round's forecast, and the motion that it began with."""

    forecast: ProgressForecast
    begun: MotionMoment


class _Given(NamedTuple):
    """A round's forecasts of what the car will measure: as the table has it, and calibrated."""

    table: ProgressForecast
    calibrated: ProgressForecast
    stamp_ns: int
    travelled_m: float
    stretch: int


class _NotYet(NamedTuple):
    """One instant of a complete round, not yet come; the next one due is the least."""

    due_ns: int
    round_id: int
    instant: int
    intersection_id: str
    given: _Given
    futures: Array | None
    """Quantiles (Q,) of the round's futures, None where none is valid."""


class ProgressForecasts:
    """Takes states and rounds in their order; the same order gives the same bits."""

    def __init__(self, model: ProgressModel, *, horizon_s: float) -> None:
        self._model = model
        self._instants = [k for k, t in enumerate(model.time_s) if t <= horizon_s + 1e-9]
        self.history = MotionHistory()
        self.calibration = Calibration(model.time_s)
        self._newest: _NewestForecast | None = None
        self._given: dict[int, _Given] = {}
        self._counted: tuple[int, int] | None = None
        self._waiting: list[_NotYet] = []

    def go_on(self, history: MotionHistory, calibration: Calibration) -> None:
        """Forecast on from what another orchestrator's forecasts had come to."""
        self.history, self.calibration = history, calibration

    def take_state(self, state: VehicleState, start_stamp_ns: int) -> list[ForecastOutcome]:
        """Add how the car moves; return what this settles."""
        drive_time_s = (state.stamp_ns - start_stamp_ns) / 1e9
        self.history.take(state.stamp_ns, state.speed_mps)
        found: list[ForecastOutcome] = []
        now, waiting = self.history.now, self._waiting
        assert now is not None
        if waiting and waiting[0].given.stretch != now.stretch:
            waiting.clear()  # nobody knows how far the car went meanwhile
        while waiting and waiting[0].due_ns <= now.stamp_ns:
            outcome = self._settled(heapq.heappop(waiting), drive_time_s)
            found += [] if outcome is None else [outcome]
        return found

    @traced("forecast of a round")
    def forecast(
        self,
        round_id: int,
        intent: RoundIntent,
        state: VehicleState,
        users: tuple[SeenRoadUser, ...],
        frame: LocalFrame,
    ) -> ProgressForecast | None:
        """Return how far the car will get from its newest state, which this round begins with.

        `users` are in the World's frame, as the intent's path. None before any motion is known.
        """
        now = self.history.now
        if now is None:
            return None
        features = feature_row(
            self.history,
            accel_mps2=state.accel_mps2,
            yaw_rate_radps=state.yaw_rate_radps,
            ahead=_ahead(intent, state, users, frame),
        )
        table = self._model.forecast(features)
        if now.speed_mps < STANDING_MPS:
            return table
        calibrated = self.calibration.calibrated(table)
        given = _Given(table, calibrated, now.stamp_ns, now.travelled_m, now.stretch)
        self._given[round_id] = given
        told = with_own_error(calibrated, state.speed_std_mps or 0.0)
        self._newest = _NewestForecast(told, now)
        return told

    def arrival_band(self, distance_m: float, *, usual_mps: float) -> ArrivalBand | None:
        """Return between when and when the car, as it is now, will have gone so far.

        `usual_mps` is what the driver usually drives. None where no round of late has a forecast.
        """
        now = self.history.now
        if self._newest is None or now is None or now.stretch != self._newest.begun.stretch:
            return None
        forecast, begun = self._newest
        since_s = (now.stamp_ns - begun.stamp_ns) / 1e9
        if since_s > TOLD_FOR_S:
            return None
        gone_m = now.travelled_m - begun.travelled_m
        band = arrival_band(forecast, gone_m + distance_m, usual_mps=usual_mps)
        if band is None:
            return None
        late_s = None if band.late_s is None else max(band.late_s - since_s, 0.0)
        return ArrivalBand(max(band.early_s - since_s, 0.0), late_s)

    def take_round(self, done: RoundDone) -> None:
        """Take a complete round: its forecast counts from when its instants have come.

        A round of the same state as the one before is no further evidence.
        """
        order = done.order
        given = self._given.pop(order.round_id, None)
        self._given = {r: one for r, one in self._given.items() if r > order.round_id}
        now = self.history.now
        if given is None or now is None or given.stretch != now.stretch:
            return
        begun = given.stamp_ns, given.stretch
        if begun == self._counted:
            return
        self._counted = begun
        spread = _spread_of_futures(done, given.calibrated, self._instants)
        for instant in self._instants:
            due_ns = given.stamp_ns + round(self._model.time_s[instant] * 1e9)
            at = None if spread is None else spread[instant]
            heapq.heappush(
                self._waiting,
                _NotYet(due_ns, order.round_id, instant, order.junction_id, given, at),
            )

    def _settled(self, one: _NotYet, drive_time_s: float) -> ForecastOutcome | None:
        """Return what came of a forecast, None where a round came too late to know."""
        given, k = one.given, one.instant
        there_m = self.history.travelled_at(one.due_ns)
        if there_m is None:
            return None
        travelled = there_m - given.travelled_m
        levels = np.array(given.calibrated.levels)
        futures = () if one.futures is None else (one.futures,)
        sides = np.stack([given.calibrated.distance_m[k], given.table.distance_m[k], *futures])
        share, table_share = share_below(levels, sides[:2], np.full((2, 1), travelled))[:, 0]
        self.calibration.take(k, drive_time_s, float(table_share))
        crps = crps_of(levels, sides, np.full(len(sides), travelled))
        p10, p50, p90 = np.interp((0.1, 0.5, 0.9), levels, sides[0]).tolist()
        return ForecastOutcome(
            round_id=one.round_id,
            stamp_ns=given.stamp_ns,
            intersection_id=one.intersection_id,
            horizon_s=float(given.calibrated.time_s[k]),
            travelled_m=travelled,
            p10_m=p10,
            p50_m=p50,
            p90_m=p90,
            share=float(share),
            crps_m=float(crps[0]),
            crps_table_m=float(crps[1]),
            crps_futures_m=float(crps[2]) if futures else None,
        )


def _ahead(
    intent: RoundIntent,
    state: VehicleState,
    users: tuple[SeenRoadUser, ...],
    frame: LocalFrame,
) -> AheadFacts:
    path = FrenetPath(intent.path.xy_m, intent.path.speed_limit_mps)
    here = local_from_geo(frame, state.position.lat_deg, state.position.lon_deg)
    arc_m = float(path.locate(here[None], upto_arc_m=CAR_WITHIN_M).arc_m[0])
    gap_m, lead_mps = lead_on(path, arc_m, users)
    facts = bends_ahead(path, arc_m)._replace(lead_gap_m=gap_m, lead_speed_mps=lead_mps)
    if intent.next_junction is None:
        return facts
    control, junction_m = intent.next_junction
    return facts._replace(junction_m=junction_m, control=float(CONTROLS.index(control)))


def _spread_of_futures(
    done: RoundDone, forecast: ProgressForecast, instants: list[int]
) -> Array | None:
    """Return (T, Q) quantiles of how far a round's valid futures get, each as likely as any other.

    None where there is none.
    """
    step_s = done.order.jobs[0].step_s
    places = [round(float(forecast.time_s[k]) / step_s) for k in instants]
    ways = [
        travelled_m(result.trajectory.states[np.asarray(result.outcome.valid, dtype=bool)])
        for result in done.results
    ]
    at = np.concatenate([np.zeros((0, len(places))), *(way[:, places] for way in ways)])
    if not len(at):
        return None
    found = np.zeros((len(forecast.time_s), len(forecast.levels)))
    found[instants] = np.quantile(at, forecast.levels, axis=0).T
    return found
