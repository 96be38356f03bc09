"""Turns results into rows of the run's tables and into what those who watch receive."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.simulation import PlanComparison
from foretwin.contracts.trace import traced
from foretwin.orchestrator.record.results import PLAN
from foretwin.orchestrator.runner.open_rounds import RoundDone
from foretwin.sim_worker.futures.columns import row_of
from foretwin.sim_worker.futures.future_rows import Row, future_rows
from foretwin.sim_worker.metrics.displacement import distinct_count

DISTINCT_M = 0.1


class RoundFutures(NamedTuple):
    """All futures of a round, joined: states (S, N, 8), outcomes, likelihood and criticality
    (S,)."""

    states: Array
    collided: Array
    min_clearance_m: Array
    valid: Array
    likelihood: Array
    criticality: Array


class FutureRows(NamedTuple):
    """A round's futures joined, their table rows, and how many end apart from the others."""

    futures: RoundFutures
    rows: list[Row]
    distinct: int


@traced("rows of a round")
def round_futures(done: RoundDone, *, vehicle: str = "") -> FutureRows:
    """Return the futures of a round as rows, each with its difference from the nominal one."""
    order = done.order
    rows = [
        row
        for job, recorded, result in zip(order.jobs, order.recorded, done.results, strict=True)
        for row in future_rows(job, result, job_sha256=recorded.sha256)
    ]
    joined = RoundFutures(
        np.concatenate([r.trajectory.states for r in done.results]).astype(np.float64),
        np.concatenate([r.outcome.collided for r in done.results]).astype(bool),
        np.concatenate([r.outcome.min_clearance_m for r in done.results]),
        np.concatenate([r.outcome.valid for r in done.results]).astype(bool),
        np.array([row["likelihood"] for row in rows]),
        np.array([row["criticality"] for row in rows], dtype=np.float64),
    )
    away_m = np.hypot(
        joined.states[:, :, 0] - joined.states[0, :, 0],
        joined.states[:, :, 1] - joined.states[0, :, 1],
    )
    for row, away in zip(rows, away_m, strict=True):
        row |= {
            "junction_id": order.junction_id,
            "vehicle": vehicle,
            "end_difference_from_nominal_m": float(away[-1]),
            "max_difference_from_nominal_m": float(away.max()),
        }
    distinct = distinct_count(joined.states[joined.valid, -1, :2], DISTINCT_M)
    return FutureRows(joined, rows, distinct)


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
        "futures": sum(len(r.future_indices) for r in done.results),
        "distinct": distinct,
        "collided": int(sum(np.count_nonzero(r.outcome.collided) for r in done.results)),
        "cruise_speed_mps": cruise_speed_mps,
        "latency_ms": done.latency_ms,
        "sim_seconds": sum(r.sim_seconds for r in done.results),
        "cpu_seconds": sum(r.cpu_seconds for r in done.results),
        "sha256": sha256,
        "vehicle_version": done.results[0].vehicle_version,
        "late": done.late,
    }


def plan_row(comparison: PlanComparison) -> dict[str, Any]:
    """Return the row of one comparison of plans."""
    row = row_of(comparison, f"{PLAN} path_offset_m")
    return row | row_of(comparison.difference)
