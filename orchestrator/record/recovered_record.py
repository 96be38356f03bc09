"""What the tables of a run tell of it, for the record of one that could not write it itself."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pyarrow as pa

from foretwin.contracts.running import RunningMeans
from foretwin.orchestrator.record.bookkeeping import (
    ComparisonCount,
    FuturesCount,
    PlanCount,
    percentile,
)
from foretwin.orchestrator.record.table_parts import read_parts

_BASELINES = "nominal", "constant_velocity", "constant_turn_rate"
_UNKNOWN = (
    *("wanted_per_round", "smaller_rounds", "missed_rounds", "spared_rounds", "unseeded_rounds"),
    "off_lanes_rounds",
)
"""What no table tells of the futures."""


def told_by_tables(results: Path) -> dict[str, Any]:
    """Return the parts of run.json that follow from the tables that can be read.

    What none of them tells is left out, never guessed. `drive_time_s` is that of the last round.
    """
    rounds, mirror = _rows(results, "rounds"), _rows(results, "mirror", "independent")
    futures, comparisons = FuturesCount(), ComparisonCount()
    for row in rounds:
        futures.take_row(row)
    for row in _rows(results, "comparisons"):
        errors = (row[f"{name}_ade_m"] for name in _BASELINES)
        comparisons.errors[row["horizon_s"]].take((next(errors), next(errors), next(errors)))
    plans = PlanCount(
        RunningMeans(
            (row["ade_m"], row["fde_m"], row["path_offset_m"])
            for row in _rows(results, "plan_comparisons")
        )
    )
    counted = futures.record(wanted=0, missed=0, spared=0, unseeded=0)
    told = {
        "futures": {name: value for name, value in counted.items() if name not in _UNKNOWN},
        "state_to_result_ms_p50": percentile(futures.latencies_ms, 50),
        "state_to_result_ms_p95": percentile(futures.latencies_ms, 95),
        "plan_comparison": plans.record(),
        "drive_time_s": round(rounds[-1]["drive_time_s"], 3) if rounds else None,
    }
    if mirror:
        told["comparison"] = comparisons.record(independent=mirror[-1]["independent"])
    return told


def _rows(results: Path, table: str, *columns: str) -> list[dict[str, Any]]:
    try:
        read = read_parts(results / f"{table}.parquet", columns=columns or None)
    except (OSError, pa.ArrowException):
        return []
    rows: list[dict[str, Any]] = read.to_pylist()
    return rows
