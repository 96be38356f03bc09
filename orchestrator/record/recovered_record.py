"""What the tables of a run tell of it, for the record of one that could not write it itself."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

from foretwin.contracts.running import RunningMeans
from foretwin.orchestrator.record.bookkeeping import (
    ComparisonCount,
    FuturesCount,
    PlanCount,
    percentile,
)
from foretwin.orchestrator.record.kept_rows import kept_rows
from foretwin.orchestrator.record.visited import visited_junctions

_BASELINES = "nominal", "constant_velocity", "constant_turn_rate"
_UNKNOWN = (
    *("wanted_per_round", "smaller_rounds", "missed_rounds", "spared_rounds", "unseeded_rounds"),
    "off_lanes_rounds",
)
"""What no table tells of the futures."""


class TableCounts(NamedTuple):
    """What the tables of a run count, and the number and drive time of its last round."""

    futures: FuturesCount
    comparisons: ComparisonCount
    plans: PlanCount
    last_round_id: int = -1
    last_round_s: float | None = None


def counted_in_tables(results: Path) -> TableCounts:
    """Return what the tables that can be read count, whether the run goes on or has ended."""
    futures, comparisons = FuturesCount(), ComparisonCount()
    rounds = kept_rows(results, "rounds")
    for row in rounds:
        futures.take_row(row)
    for row in kept_rows(results, "comparisons"):
        errors = (row[f"{name}_ade_m"] for name in _BASELINES)
        comparisons.errors[row["horizon_s"]].take((next(errors), next(errors), next(errors)))
    columns = "ade_m", "fde_m", "path_offset_m"
    plans = kept_rows(results, "plan_comparisons", *columns)
    last = (rounds[-1]["round_id"], rounds[-1]["drive_time_s"]) if rounds else ()
    counted = PlanCount(RunningMeans([row[name] for name in columns] for row in plans))
    return TableCounts(futures, comparisons, counted, *last)


def told_by_tables(results: Path) -> dict[str, Any]:
    """Return the parts of run.json that follow from the tables that can be read.

    What none of them tells is left out, never guessed. `drive_time_s` is that of the last round.
    """
    counts = counted_in_tables(results)
    mirror = kept_rows(results, "mirror", "independent")
    counted = counts.futures.record(wanted=0, missed=0, spared=0, unseeded=0)
    latencies_ms = counts.futures.latencies_ms
    told = {
        "futures": {name: value for name, value in counted.items() if name not in _UNKNOWN},
        "state_to_result_ms_p50": percentile(latencies_ms, 50),
        "state_to_result_ms_p95": percentile(latencies_ms, 95),
        "plan_comparison": counts.plans.record(),
        "intersections": visited_junctions(results).records,
        "drive_time_s": None if counts.last_round_s is None else round(counts.last_round_s, 3),
    }
    if mirror:
        told["comparison"] = counts.comparisons.record(independent=mirror[-1]["independent"])
    return told
