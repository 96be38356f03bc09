"""Turns results into rows of the run's tables and into what those who watch receive."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.futures import FuturesResult, Variant
from foretwin.contracts.simulation import Comparison, HorizonError, PlanComparison
from foretwin.orchestrator.rounds.dispatch import RoundDone
from foretwin.sim_worker.metrics.displacement import distinct_count

DISTINCT_M = 0.1


class RoundFutures(NamedTuple):
    """All futures of a round, joined: states (S, N, 8) and outcomes (S,)."""

    states: Array
    collided: Array
    min_clearance_m: Array
    valid: Array


class FutureRows(NamedTuple):
    """A round's futures joined, their table rows, and how many end apart from the others."""

    futures: RoundFutures
    rows: list[dict[str, Any]]
    distinct: int


def future_rows(done: RoundDone, variants: Sequence[Variant]) -> FutureRows:
    """Return the futures of a round as rows, each with its difference from the nominal one.

    `variants` are those of the round, in the order of its jobs.
    """
    futures = RoundFutures(
        np.concatenate([r.trajectory.states for r in done.results]).astype(np.float64),
        np.concatenate([r.outcome.collided for r in done.results]).astype(bool),
        np.concatenate([r.outcome.min_clearance_m for r in done.results]),
        np.concatenate([r.outcome.valid for r in done.results]).astype(bool),
    )
    away_m = np.hypot(
        futures.states[:, :, 0] - futures.states[0, :, 0],
        futures.states[:, :, 1] - futures.states[0, :, 1],
    )
    rows = []
    number = 0
    for result in done.results:
        outcome = result.outcome
        for place, variant_index in enumerate(result.variant_indices):
            variant = variants[number]
            end = futures.states[number, -1]
            rows.append(
                {
                    "round_id": done.order.round_id,
                    "stamp_ns": done.order.stamp_ns,
                    "variant": variant_index,
                    "name": variant.name,
                    "planner": variant.planner,
                    "scenario": _happened(result, place, variant),
                    "failure": outcome.failures[place] if outcome.failures else "",
                    "remark": outcome.remarks[place] if outcome.remarks else "",
                    "worker_id": result.worker_id,
                    "valid": bool(outcome.valid[place]),
                    "collided": bool(outcome.collided[place]),
                    "collision_time_s": _or_none(outcome.collision_time_s[place]),
                    "collision_with": int(outcome.collision_with[place]),
                    "min_clearance_m": _or_none(outcome.min_clearance_m[place]),
                    "progress_m": _or_none(outcome.progress_m[place]),
                    "end_x_m": float(end[0]),
                    "end_y_m": float(end[1]),
                    "end_yaw_rad": float(end[2]),
                    "end_speed_mps": float(np.hypot(end[3], end[4])),
                    "end_difference_from_nominal_m": float(away_m[number, -1]),
                    "max_difference_from_nominal_m": float(away_m[number].max()),
                }
            )
            number += 1
    distinct = distinct_count(futures.states[futures.valid, -1, :2], DISTINCT_M)
    return FutureRows(futures, rows, distinct)


def _happened(result: FuturesResult, place: int, variant: Variant) -> str:
    """Return the scenario of a future; empty where it has none, or it was left out."""
    return "" if result.left_out and result.left_out[place] else variant.scenario_id


def round_row(
    done: RoundDone, *, start_stamp_ns: int, distinct: int, sha256: str, cruise_speed_mps: float
) -> dict[str, Any]:
    """Return the row of a round."""
    return {
        "round_id": done.order.round_id,
        "stamp_ns": done.order.stamp_ns,
        "drive_time_s": (done.order.stamp_ns - start_stamp_ns) / 1e9,
        "intersection_id": done.order.junction_id,
        "world_id": done.order.world_id,
        "futures": sum(len(r.variant_indices) for r in done.results),
        "distinct": distinct,
        "collided": int(sum(np.count_nonzero(r.outcome.collided) for r in done.results)),
        "cruise_speed_mps": cruise_speed_mps,
        "latency_ms": done.latency_ms,
        "sim_seconds": sum(r.sim_seconds for r in done.results),
        "cpu_seconds": sum(r.cpu_seconds for r in done.results),
        "sha256": sha256,
        "vehicle_version": done.results[0].vehicle_version,
    }


def comparison_row(comparison: Comparison) -> dict[str, Any]:
    """Return the row of one comparison."""
    row: dict[str, Any] = {
        "round_id": comparison.round_id,
        "stamp_ns": comparison.stamp_ns,
        "intersection_id": comparison.intersection_id,
        "horizon_s": comparison.horizon_s,
    }
    for who in ("nominal", "constant_velocity", "constant_turn_rate"):
        row |= {f"{who}_{k}": v for k, v in _error(getattr(comparison, who)).items()}
    return row


def plan_row(comparison: PlanComparison) -> dict[str, Any]:
    """Return the row of one comparison of plans."""
    return {
        "round_id": comparison.round_id,
        "stamp_ns": comparison.stamp_ns,
        "plan_stamp_ns": comparison.plan_stamp_ns,
        "horizon_s": comparison.horizon_s,
        "path_offset_m": comparison.path_offset_m,
        **_error(comparison.difference),
    }


def _error(error: HorizonError) -> dict[str, float]:
    return {name: getattr(error, name) for name in HorizonError.__struct_fields__}


def _or_none(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
