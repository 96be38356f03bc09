"""From a job and its result to rows, one for each future: the same whether it was live or swept."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import numpy as np

from foretwin.contracts.future_numbers import numbers_of
from foretwin.contracts.futures import (
    COLLISION_WITH,
    Future,
    FuturesResult,
    Job,
)
from foretwin.contracts.job_identity import future_id
from foretwin.contracts.numbers import FUTURE_NUMBERS
from foretwin.sim_worker.futures.likelihood import risks
from foretwin.sim_worker.metrics.table import ROW_METRICS

Row = dict[str, Any]

_COLUMNS: tuple[tuple[type, str], ...] = (
    (str, "future_id job_sha256"),
    (int, "round_id job_index index"),
    (str, "name"),
    (int, "stamp_ns"),
    (str, "world_id junction_id planner vehicle"),
    (int, "vehicle_version seed"),
    (float, "horizon_s"),
    (str, "scenario place"),
    (int, "cell case"),
    (dict, "values"),
    (int, "seen_road_users replayed_road_users"),
    (float, " ".join(FUTURE_NUMBERS)),
    (bool, "valid"),
    (str, "failure remark left_out"),
    (float, "planned_impact_time_s"),
    (str, "planned_impact_with"),
    (float, "planned_impact_off_m"),
    (bool, "collided"),
    (float, "collision_time_s"),
    (str, "collision_with"),
    (float, "likelihood criticality"),
    (float, "min_clearance_m progress_m end_x_m end_y_m end_yaw_rad end_speed_mps"),
    (float, "end_difference_from_nominal_m max_difference_from_nominal_m"),
    (str, "accident_with accident_kind"),
    (float, "accident_time_s accident_x_m accident_y_m accident_angle_rad accident_closing_mps"),
    (float, "accident_ego_delta_v_mps accident_user_delta_v_mps"),
    (float, " ".join(f"metric_{name}" for name in ROW_METRICS)),
    (str, "trajectory_sha256 worker_id"),
)
FUTURE_COLUMNS: Mapping[str, type] = MappingProxyType(
    {name: kind for kind, names in _COLUMNS for name in names.split()}
)
"""Columns of the table of futures and what they hold; null where one does not apply."""


def road_user_names(job: Job, future: Future) -> tuple[str, ...]:
    """Return what the other road users of a future are called, in the order of its tracks."""
    scenario = next((s for s in job.scenarios if s.id == future.scenario_id), None)
    return (
        *(f"recorded {user.user_id}" for user in job.replayed),
        *(f"seen {user.user_id}" for user in job.road_users),
        *(actor.name for actor in (() if scenario is None else scenario.actors)),
    )


def future_rows(job: Job, result: FuturesResult | None, *, job_sha256: str) -> list[Row]:
    """Return the rows of a job's futures, in its order; without a result, what is known before."""
    places = {} if result is None else {i: p for p, i in enumerate(result.future_indices)}
    unplaced = {} if result is None else dict(result.unplaced)
    rows = []
    numbers = {} if result is None else _measured_numbers(job, result)
    for future in job.futures:
        row = _job_columns(job, future, job_sha256)
        if result is not None and future.index in places:
            place = places[future.index]
            row |= _result_columns(job, future, result, place)
            row |= {name: values[place] for name, values in numbers.items()}
        elif result is not None:
            row["left_out"] = unplaced[future.index]
        rows.append(row)
    return rows


_OF_JOB = ("round_id", "job_index", "world_id", "vehicle_version", "seed", "horizon_s")
_OF_ACCIDENT = ("time_s", "angle_rad", "closing_mps", "ego_delta_v_mps", "user_delta_v_mps")


def motion_sha256(result: FuturesResult, place: int) -> str:
    """Return a hash of how the car and all others move in a future, by its place in its result.

    It is that of the future in any job: places of road users whom only others of its job have are
    left out.
    """
    states, users = result.trajectory.states[place], result.road_users.poses[place]
    there = users[:, ~np.isnan(users[:, :, 0]).all(axis=0)]
    moved = np.ascontiguousarray(states).tobytes() + np.ascontiguousarray(there).tobytes()
    return hashlib.sha256(moved).hexdigest()


def _job_columns(job: Job, future: Future, job_sha256: str) -> Row:
    return {
        **{name: getattr(job, name) for name in _OF_JOB},
        **numbers_of(future),
        **dict.fromkeys(("failure", "remark", "left_out", "planned_impact_with"), ""),
        "future_id": future_id(job_sha256, future.index),
        "job_sha256": job_sha256,
        "index": future.index,
        "name": future.name,
        "stamp_ns": None if future.place else job.state.stamp_ns,
        "planner": future.planner,
        "scenario": future.scenario_id,
        "place": future.place,
        "values": list(future.values.items()),
        "seen_road_users": len(job.road_users),
        "replayed_road_users": len(job.replayed),
    }


def _measured_numbers(job: Job, result: FuturesResult) -> dict[str, list[float | None]]:
    """Return the numbers of a result's futures, by column, in its order."""
    outcome, planned, risk = result.outcome, result.planned, risks(job, result)
    columns = {f"metric_{name}": values for name, values in result.metrics.items()}
    columns |= {
        name: getattr(outcome, name)
        for name in ("collision_time_s", "min_clearance_m", "progress_m")
    }
    columns |= {"likelihood": risk.likelihood, "criticality": risk.criticality}
    if planned is not None:
        columns["planned_impact_time_s"] = planned.time_s
        columns["planned_impact_off_m"] = planned.off_m
    table = np.array(list(columns.values()), dtype=np.float64)
    numbers: list[list[float | None]] = table.tolist()
    for column, place in np.argwhere(~np.isfinite(table)).tolist():
        numbers[column][place] = None  # as tables have one that there is not
    return dict(zip(columns, numbers, strict=True))


def _result_columns(job: Job, future: Future, result: FuturesResult, place: int) -> Row:
    outcome, planned = result.outcome, result.planned
    states = np.ascontiguousarray(result.trajectory.states[place])
    users = np.ascontiguousarray(result.road_users.poses[place])
    x, y, yaw, ahead_mps, left_mps = states[-1, :5].astype(np.float64)
    row: Row = {
        "valid": None if place in (outcome.lost or ()) else bool(outcome.valid[place]),
        "failure": outcome.failures[place] if outcome.failures else "",
        "remark": outcome.remarks[place] if outcome.remarks else "",
        "left_out": result.left_out[place],
        "collided": bool(outcome.collided[place]),
        "collision_with": COLLISION_WITH[int(outcome.collision_with[place])],
        "end_speed_mps": float(np.hypot(ahead_mps, left_mps)),
        "trajectory_sha256": hashlib.sha256(states.tobytes() + users.tobytes()).hexdigest(),
        "worker_id": result.worker_id,
    }
    row |= _place("end", x, y) | {"end_yaw_rad": float(yaw)}
    if planned is not None:
        row["planned_impact_with"] = planned.met[place]
    for accident in result.accidents:
        if accident.future == place:
            kind = result.road_users.kinds[place, accident.road_user]
            row["accident_with"] = road_user_names(job, future)[accident.road_user]
            row["accident_kind"] = result.road_users.kind_names[int(kind)]
            row |= {f"accident_{name}": getattr(accident, name) for name in _OF_ACCIDENT}
            row |= _place("accident", *accident.point_m)
    return row


def _place(what: str, x_m: float, y_m: float) -> Row:
    return {f"{what}_x_m": float(x_m), f"{what}_y_m": float(y_m)}
