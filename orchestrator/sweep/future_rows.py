"""From a played job to what rows say of its futures."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Sequence

import numpy as np

from foretwin.contracts.arrays import Array32
from foretwin.contracts.futures import Accident, FuturesResult
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.orchestrator.sweep.rows import Row
from foretwin.orchestrator.sweep.spec import STEP_S
from foretwin.sim_worker.futures.ego_dry_run import off_plan_m
from foretwin.sim_worker.road_users.cast import KIND_NAMES
from foretwin.sim_worker.scenarios.roles import Cast

COLLISION_WITH = ("", "road_user", "static")


def told(result: FuturesResult, index: int, names: Sequence[str]) -> Row:
    """Return the columns that the playing of one future fills; `names` are its road users'."""
    outcome, accident = result.outcome, _accident_of(result, index)
    states = np.ascontiguousarray(result.trajectory.states[index])
    users = np.ascontiguousarray(result.road_users.poses[index])
    row: Row = {
        "valid": bool(outcome.valid[index]),
        "failure": outcome.failures[index] if outcome.failures else "",
        "left_out": result.left_out[index],
        "planned_impact_with": "",
        "collided": bool(outcome.collided[index]),
        "collision_time_s": _number(outcome.collision_time_s[index]),
        "collision_with": COLLISION_WITH[int(outcome.collision_with[index])],
        "min_clearance_m": _number(outcome.min_clearance_m[index]),
        "progress_m": _number(outcome.progress_m[index]),
        "trajectory_sha256": hashlib.sha256(states.tobytes() + users.tobytes()).hexdigest(),
    }
    row |= {f"metric_{name}": _number(values[index]) for name, values in result.metrics.items()}
    if accident is not None:
        row |= _accident(result, accident) | {"accident_with": names[accident.road_user]}
    return row


def told_of_case(result: FuturesResult, index: int, case: Cast, vehicle: VehicleParameters) -> Row:
    """Return these columns of a future that was cast at its place, where an impact was planned."""
    row = told(result, index, [actor.name for actor in case.actors])
    row["planned_impact_time_s"] = _number(case.impact_time_s)
    row["planned_impact_with"] = case.impact_with
    accident = _accident_of(result, index)
    if accident is not None and row["accident_with"] == case.impact_with:
        states = result.trajectory.states[index]
        row["planned_impact_off_m"] = _off_m(states, accident.time_s, case, vehicle)
    return row


def _accident_of(result: FuturesResult, index: int) -> Accident | None:
    return next((a for a in result.accidents if a.future == index), None)


def _off_m(states: Array32, time_s: float, case: Cast, vehicle: VehicleParameters) -> float:
    """Return how far the point of the ego that was to be hit is from where that was planned.

    The ego goes on from the last instant before the touch as it moves then.
    """
    last = max(math.ceil(time_s / STEP_S - 1e-6) - 1, 0)
    x, y, yaw, ahead_mps, left_mps, yaw_rate = states[last, :6].astype(np.float64)
    since_s = time_s - last * STEP_S
    heading = yaw + yaw_rate * since_s / 2.0
    x += (ahead_mps * np.cos(heading) - left_mps * np.sin(heading)) * since_s
    y += (ahead_mps * np.sin(heading) + left_mps * np.cos(heading)) * since_s
    there = np.array([x, y, yaw + yaw_rate * since_s])
    return off_plan_m(case, there, vehicle)


def _accident(result: FuturesResult, accident: Accident) -> Row:
    kind = KIND_NAMES[int(result.road_users.kinds[accident.future, accident.road_user])]
    return {
        "accident_kind": kind,
        "accident_time_s": accident.time_s,
        "accident_x_m": float(accident.point_m[0]),
        "accident_y_m": float(accident.point_m[1]),
        "accident_angle_rad": accident.angle_rad,
        "accident_closing_mps": accident.closing_mps,
        "accident_ego_delta_v_mps": accident.ego_delta_v_mps,
        "accident_user_delta_v_mps": accident.user_delta_v_mps,
    }


def _number(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
