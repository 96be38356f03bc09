"""From a job and its result to rows, one for each future: the same whether it was live or swept."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import msgspec
import numpy as np

from foretwin.contracts.futures import (
    COLLISION_WITH,
    Accident,
    Future,
    FuturesResult,
    Job,
    numbers_of,
)
from foretwin.contracts.job_identity import future_id
from foretwin.contracts.numbers import FUTURE_NUMBERS
from foretwin.sim_worker.metrics.table import ROW_METRICS

Row = dict[str, Any]

FUTURE_COLUMNS: Mapping[str, type] = MappingProxyType({
    "future_id": str, "job_sha256": str, "round_id": int, "job_index": int, "index": int,
    "name": str, "stamp_ns": int, "world_id": str, "junction_id": str, "planner": str,
    "vehicle": str, "vehicle_version": int, "seed": int, "horizon_s": float,
    "scenario": str, "place": str, "cell": int, "case": int, "values": dict,
    "seen_road_users": int, "replayed_road_users": int,
    **dict.fromkeys(FUTURE_NUMBERS, float),
    "valid": bool, "failure": str, "remark": str, "left_out": str,
    "planned_impact_time_s": float, "planned_impact_with": str, "planned_impact_off_m": float,
    "collided": bool, "collision_time_s": float, "collision_with": str, "min_clearance_m": float,
    "progress_m": float, "end_x_m": float, "end_y_m": float, "end_yaw_rad": float,
    "end_speed_mps": float, "end_difference_from_nominal_m": float,
    "max_difference_from_nominal_m": float,
    "accident_with": str, "accident_kind": str, "accident_time_s": float, "accident_x_m": float,
    "accident_y_m": float, "accident_angle_rad": float, "accident_closing_mps": float,
    "accident_ego_delta_v_mps": float, "accident_user_delta_v_mps": float,
    **{f"metric_{name}": float for name in ROW_METRICS},
    "trajectory_sha256": str, "worker_id": str,
})  # fmt: skip
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
    for future in job.futures:
        row = _asked(job, future, job_sha256)
        if result is not None and future.index in places:
            row |= _played(job, future, result, places[future.index])
        elif result is not None:
            row["left_out"] = unplaced[future.index]
        rows.append(row)
    return rows


def rows_as_bytes(rows: list[Row]) -> bytes:
    """Return rows as they travel."""
    return msgspec.msgpack.encode(rows)


def rows_from_bytes(data: bytes, job: Job) -> list[Row]:
    """Return the rows of a job from `rows_as_bytes`; raises msgspec.DecodeError for other bytes."""
    rows: list[Row] = msgspec.msgpack.decode(data, type=list[Row])
    for row, future in zip(rows, job.futures, strict=True):
        row["values"] = list(future.values.items())  # Jobs travel with their names sorted.
    return rows


def _asked(job: Job, future: Future, job_sha256: str) -> Row:
    return {
        "future_id": future_id(job_sha256, future.index), "job_sha256": job_sha256,
        "round_id": job.round_id, "job_index": job.job_index, "index": future.index,
        "name": future.name, "stamp_ns": None if future.place else job.state.stamp_ns,
        "world_id": job.world_id, "planner": future.planner,
        "vehicle_version": job.vehicle_version, "seed": job.seed, "horizon_s": job.horizon_s,
        "scenario": future.scenario_id, "place": future.place,
        "values": list(future.values.items()), "seen_road_users": len(job.road_users),
        "replayed_road_users": len(job.replayed), **numbers_of(future), "failure": "",
        "remark": "", "left_out": "", "planned_impact_with": "",
    }  # fmt: skip


def _played(job: Job, future: Future, result: FuturesResult, place: int) -> Row:
    outcome, planned = result.outcome, result.planned
    states = np.ascontiguousarray(result.trajectory.states[place])
    users = np.ascontiguousarray(result.road_users.poses[place])
    end = states[-1].astype(np.float64)
    row: Row = {
        "valid": bool(outcome.valid[place]),
        "failure": outcome.failures[place] if outcome.failures else "",
        "remark": outcome.remarks[place] if outcome.remarks else "",
        "left_out": result.left_out[place],
        "collided": bool(outcome.collided[place]),
        "collision_time_s": _number(outcome.collision_time_s[place]),
        "collision_with": COLLISION_WITH[int(outcome.collision_with[place])],
        "min_clearance_m": _number(outcome.min_clearance_m[place]),
        "progress_m": _number(outcome.progress_m[place]),
        "end_x_m": float(end[0]), "end_y_m": float(end[1]), "end_yaw_rad": float(end[2]),
        "end_speed_mps": float(np.hypot(end[3], end[4])),
        "trajectory_sha256": hashlib.sha256(states.tobytes() + users.tobytes()).hexdigest(),
        "worker_id": result.worker_id,
    }  # fmt: skip
    row |= {f"metric_{name}": _number(values[place]) for name, values in result.metrics.items()}
    if planned is not None:
        row |= {
            "planned_impact_time_s": _number(planned.time_s[place]),
            "planned_impact_with": planned.met[place],
            "planned_impact_off_m": _number(planned.off_m[place]),
        }
    for accident in result.accidents:
        if accident.future == place:
            names = road_user_names(job, future)
            row |= _accident(result, accident) | {"accident_with": names[accident.road_user]}
    return row


def _accident(result: FuturesResult, accident: Accident) -> Row:
    tracks = result.road_users
    return {
        "accident_kind": tracks.kind_names[int(tracks.kinds[accident.future, accident.road_user])],
        "accident_time_s": accident.time_s,
        "accident_x_m": float(accident.point_m[0]), "accident_y_m": float(accident.point_m[1]),
        "accident_angle_rad": accident.angle_rad,
        "accident_closing_mps": accident.closing_mps,
        "accident_ego_delta_v_mps": accident.ego_delta_v_mps,
        "accident_user_delta_v_mps": accident.user_delta_v_mps,
    }  # fmt: skip


def _number(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
