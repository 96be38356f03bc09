"""What staged futures were to come to, and how near to it they came."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from foretwin.contracts.arrays import Array, Array32
from foretwin.contracts.futures import Accident, PlannedImpacts
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.sim_worker.futures.driven_touch import off_plan_m
from foretwin.sim_worker.scenarios.roles import StagedCase


def planned_impacts(
    cases: Mapping[int, StagedCase],
    states: Array32,
    accidents: Sequence[Accident],
    vehicle: VehicleParameters,
    *,
    step_s: float,
) -> PlannedImpacts | None:
    """Return what was planned in S futures, `cases` by their places; `states` (S, N, 8).

    None where there is no case.
    """
    if not cases:
        return None
    time_s, off_m = np.full((2, len(states)), np.nan)
    met = [""] * len(states)
    for place, case in cases.items():
        time_s[place], met[place] = case.impact_time_s, case.impact_with
    for accident in accidents:
        met_in = cases.get(accident.future)
        if met_in is not None and met_in.actors[accident.road_user].name == met_in.impact_with:
            there = _state_at(states[accident.future], accident.time_s, step_s)
            off_m[accident.future] = off_plan_m(met_in, there, vehicle)
    return PlannedImpacts(time_s=time_s, met=tuple(met), off_m=off_m)


def _state_at(states: Array32, time_s: float, step_s: float) -> Array:
    """Return x, y and yaw at a touch: the ego goes on from the last instant before as it moves."""
    last = max(math.ceil(time_s / step_s - 1e-6) - 1, 0)
    x, y, yaw, ahead_mps, left_mps, yaw_rate = states[last, :6].astype(np.float64)
    since_s = time_s - last * step_s
    heading = yaw + yaw_rate * since_s / 2.0
    x += (ahead_mps * np.cos(heading) - left_mps * np.sin(heading)) * since_s
    y += (ahead_mps * np.sin(heading) + left_mps * np.cos(heading)) * since_s
    return np.array([x, y, yaw + yaw_rate * since_s])
