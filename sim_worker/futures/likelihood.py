"""How likely each future of a job is, and how grave: what of a round is worth a look.

A future's likelihood is 1 where nothing is likelier: the stated prior of what distinguishes it
(`scenarios/exposure.py`) times how dense the job's forecast of the car's progress is where this
future goes. Its criticality is that times its severity, the risk that somebody dies.
"""

from __future__ import annotations

from typing import NamedTuple

import msgspec
import numpy as np

from foretwin.contracts.arrays import Array, Array32
from foretwin.contracts.forecast import ProgressForecast, share_below
from foretwin.contracts.futures import COLLISION_WITH, FuturesResult, Job
from foretwin.sim_worker.scenarios.exposure import prior

SMOOTH_PART = 0.125
"""Of the band from p10 to p90: over so much to either side its density is averaged."""
LEAST_DENSITY = 1e-6
REACTS_AFTER_S = 2.0
"""Where somebody else acts, the car's progress says how likely the future is until it may react."""
NEAR_MISS_M, NEAR_MISS = 2.0, 1e-4
"""Who passes nobody at so much is not near; who just does not touch counts as a bump at walking
pace. Chosen: it ranks near misses below collisions."""
_STATIC = COLLISION_WITH.index("static")
_UNPROTECTED = ("pedestrian", "bicycle", "motorcycle")
"""Whom no belt and no body of a car holds: hit, they are thrown, whatever their vehicle weighs.
Riders are taken to die as pedestrians do; that curve is not measured of them."""
_KMH = 3.6


class FutureRisk(NamedTuple):
    """Of S played futures: likelihood, severity and their product; all (S,) from 0 to 1.

    NaN is the severity of a collision with a road user of which no accident was computed.
    """

    likelihood: Array
    severity: Array

    @property
    def criticality(self) -> Array:
        """(S,) likelihood times severity."""
        return self.likelihood * self.severity


def risks(job: Job, result: FuturesResult) -> FutureRisk:
    """Return how likely and how grave each future of a result is; 0 where it was not valid."""
    futures = {future.index: future for future in job.futures}
    mixed = len({future.planner for future in job.futures}) > 1
    priors = np.array(
        [
            prior(futures[index], happens=not reason, mixed_planners=mixed)
            for index, reason in zip(result.future_indices, result.left_out, strict=True)
        ]
    )
    valid = np.asarray(result.outcome.valid, dtype=bool)
    return FutureRisk(
        np.where(valid, priors * _progress_part(job, result), 0.0),
        np.where(valid, _severity(result), 0.0),
    )


def travelled_m(states: Array | Array32) -> Array:
    """Return (S, N) how far each of S futures has gone at each instant of its states (S, N, 8)."""
    xy = np.asarray(states[:, :, :2], dtype=np.float64)
    steps = np.hypot(*np.moveaxis(np.diff(xy, axis=1), -1, 0))
    return np.concatenate([np.zeros((len(xy), 1)), np.cumsum(steps, axis=1)], axis=1)


def _progress_part(job: Job, result: FuturesResult) -> Array:
    """Return (S,) the density of the forecast along each future, 1 where it is highest.

    The geometric mean over the instants: they say about the same thing eight times.
    """
    forecast = job.progress
    count = len(result.future_indices)
    if forecast is msgspec.UNSET or not count:
        return np.ones(count)
    times_s = result.trajectory.time_s
    known = np.flatnonzero(forecast.time_s <= times_s[-1] + 1e-9)
    if not len(known):
        return np.ones(count)
    places = np.searchsorted(times_s, forecast.time_s[known] - 1e-6)
    went_m = travelled_m(result.trajectory.states)[:, places].T
    density = relative_density(forecast, went_m, known.tolist())
    futures = {future.index: future for future in job.futures}
    until_s = np.array(
        [
            REACTS_AFTER_S if futures[index].scenario_id and not reason else np.inf
            for index, reason in zip(result.future_indices, result.left_out, strict=True)
        ]
    )
    hit_s = np.where(result.outcome.collided, result.outcome.collision_time_s, np.inf)
    until_s = np.minimum(until_s, hit_s)
    counts = forecast.time_s[known][:, None] <= until_s + 1e-9
    logs = np.where(counts, np.log(density), 0.0).sum(axis=0)
    return np.asarray(np.exp(logs / np.maximum(counts.sum(axis=0), 1)))


def relative_density(forecast: ProgressForecast, distance_m: Array, instants: list[int]) -> Array:
    """Return (T, V) how dense a forecast is at distances (T, V) of some of its instants, 1 where
    it is densest."""
    quantiles = forecast.distance_m[instants]
    levels = np.asarray(forecast.levels)
    reach = SMOOTH_PART * (forecast.at(0.9) - forecast.at(0.1))[instants][:, None]

    values = np.concatenate([quantiles, distance_m], axis=1)
    below, above = np.split(
        share_below(levels, quantiles, np.concatenate([values - reach, values + reach], axis=1)),
        2,
        axis=1,
    )
    within, own = above - below, quantiles.shape[1]
    most = within[:, :own].max(axis=1, keepdims=True)
    return np.asarray(np.clip(within[:, own:] / most, LEAST_DENSITY, 1.0))


def _severity(result: FuturesResult) -> Array:
    """Return (S,) the risk that somebody dies."""
    outcome, states = result.outcome, result.trajectory.states
    clearance = np.where(np.isfinite(outcome.min_clearance_m), outcome.min_clearance_m, np.inf)
    found = NEAR_MISS * np.clip(1.0 - clearance / NEAR_MISS_M, 0.0, 1.0)
    speed = np.hypot(states[:, :, 3].astype(np.float64), states[:, :, 4])
    step_s = float(result.trajectory.time_s[1])
    told = outcome.collided & (outcome.collision_with == _STATIC)
    for row in np.flatnonzero(told).tolist():
        # Between two instants the physics may have stopped it: the one before says how fast.
        before = int(max(np.ceil(outcome.collision_time_s[row] / step_s - 1e-6) - 1, 0))
        at_mps = float(speed[row, min(before, speed.shape[1] - 1)])
        # All of it may go at once.
        found[row] = max(found[row], occupant_risk(at_mps))
    for accident in result.accidents:
        if accident.future >= len(found):
            continue
        kind = result.road_users.kind_names[
            int(result.road_users.kinds[accident.future, accident.road_user])
        ]
        if kind in _UNPROTECTED:
            risk = pedestrian_risk(accident.closing_mps)
        else:
            most = max(accident.ego_delta_v_mps, accident.user_delta_v_mps)
            risk = occupant_risk(most)
        found[accident.future] = max(found[accident.future], risk)
        told[accident.future] = True
    # Any collision is graver than any near miss; how much graver, accidents alone tell.
    found = np.where(outcome.collided, np.maximum(found, NEAR_MISS), found)
    return np.where(outcome.collided & ~told, np.nan, found)


def pedestrian_risk(impact_mps: float) -> float:
    """Return the risk of dying of who is hit on foot at this speed.

    Rosén, Sander 2009, doi.org/10.1016/j.aap.2009.02.002: at 50 km/h, where it is 8 %, more than
    twice that at 40 and more than five times that at 30 km/h.
    """
    return float(1.0 / (1.0 + np.exp(6.9 - 0.090 * abs(impact_mps) * _KMH)))


def occupant_risk(delta_v_mps: float) -> float:
    """Return the risk of dying of a belted occupant whose car's speed changes by so much.

    A logistic curve through Richards, Cuerden 2009 (Department for Transport, Road Safety Web
    Publication 9): in frontal impacts 3 % of drivers at 30 mph and 92 % at 60 mph. From the side
    they say 90 % at 40 mph, of few cases: this curve has 18 %.
    """
    return float(1.0 / (1.0 + np.exp(9.3 - 0.121 * abs(delta_v_mps) * _KMH)))
