"""The record of a run that could not write its own: what it had said so far, and what its tables,
its recording and its processes' files tell. What none of them tells is unknown, never guessed."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from foretwin.contracts.cpu_use import cpu_uses
from foretwin.contracts.running import RunningMeans
from foretwin.contracts.segments import DRIVE_FILE
from foretwin.contracts.siblings import Siblings
from foretwin.contracts.tally import tally_file
from foretwin.orchestrator.record.bookkeeping import (
    ComparisonCount,
    FuturesCount,
    PlanCount,
    percentile,
)
from foretwin.orchestrator.record.forecast_count import ForecastCount
from foretwin.orchestrator.record.kept_parts import kept_record, read_removed
from foretwin.orchestrator.record.kept_rows import kept_rows
from foretwin.orchestrator.record.ledger import JobsLedger, RoundsLedger
from foretwin.orchestrator.record.refused_elsewhere import refused_elsewhere
from foretwin.orchestrator.record.run_state import PROCESSES, RESULTS
from foretwin.orchestrator.record.sibling_count import SiblingCount
from foretwin.orchestrator.record.so_far import read_so_far
from foretwin.orchestrator.record.telemetry_ledger import telemetry_ledger
from foretwin.orchestrator.record.visited import visited_junctions
from foretwin.telemetry.processes.tally_left import tally_left

_BASELINES = "nominal", "constant_velocity", "constant_turn_rate"
_JOINING = ("endpoint", "credentials")
"""How a drive was spoken to while it went on."""
_TOLD_WHILE_DRIVING = (
    *("changes", "telemetry", "tuning", "comparison", "calibration", "plan_comparison"),
    "side_by_side",
    *("agreement", "orchestrator", "workers", "dropped", "refused", "troubles", "off_road"),
    *("memory", "left_out", "wall_s"),
)
_OF_FUTURES = (
    *("missed_rounds", "spared_rounds", "unseeded_rounds", "off_lanes_rounds"),
    *("not_placed", "failed", "remarked"),
)
"""What no table tells: of the run, and of its futures."""


class TableCounts(NamedTuple):
    """What the tables of a run count, and the number and drive time of its last round."""

    futures: FuturesCount
    comparisons: ComparisonCount
    plans: PlanCount
    forecasts: ForecastCount
    siblings: SiblingCount
    last_round_id: int = -1
    last_round_s: float | None = None


class RecoveredRecord(NamedTuple):
    """A record, and by name the parts of it that nobody knows any more; they are None in it."""

    record: dict[str, Any]
    unknown: tuple[str, ...]
    told_until_s: float | None
    """The drive time up to which is known what tables do not tell; None: nothing of it is."""


def counted_in_tables(results: Path) -> TableCounts:
    """Return what the tables that can be read count, whether the run goes on or has ended."""
    futures, comparisons = FuturesCount(), ComparisonCount()
    rounds = kept_rows(results, "rounds")
    for row in rounds:
        futures.take_row(row)
    siblings = SiblingCount()
    for row in kept_rows(results, "siblings"):
        siblings.take(row)
    for row in kept_rows(results, "comparisons"):
        siblings.take_error(row["round_id"], row["horizon_s"], row["nominal_fde_m"])
        errors = (row[f"{name}_ade_m"] for name in _BASELINES)
        comparisons.errors[row["horizon_s"]].take((next(errors), next(errors), next(errors)))
        if (weighted := row.get("weighted_ade_m")) is not None:  # none of an older foretwin
            comparisons.weighted[row["horizon_s"]].take((weighted,))
    columns = "ade_m", "fde_m", "path_offset_m"
    plans = kept_rows(results, "plan_comparisons", *columns)
    last = (rounds[-1]["round_id"], rounds[-1]["drive_time_s"]) if rounds else ()
    counted = PlanCount(RunningMeans([row[name] for name in columns] for row in plans))
    forecasts = ForecastCount()
    forecasts.take_rows(kept_rows(results, "forecasts"))
    return TableCounts(futures, comparisons, counted, forecasts, siblings, *last)


def recovered_record(
    run: Path, begun: Mapping[str, Any], *, agreement: dict[str, Any] | None, torn: bool
) -> RecoveredRecord:
    """Return the record of a run that was killed.

    `begun` is what its run.json says, `agreement` what its windows were judged to, None where
    they could not be; `torn` says that the recording had no end.
    """
    so_far = read_so_far(run)
    said = {} if so_far is None else so_far.record
    base = {name: value for name, value in begun.items() if name not in _JOINING}
    told = {"run_id": run.resolve().name} | base | dict.fromkeys(_TOLD_WHILE_DRIVING) | said
    told |= _told_by_tables(run, told)
    told |= {"agreement": agreement} if agreement is not None else {}
    told["processor"] = msgspec.to_builtins(cpu_uses(run / PROCESSES))
    told |= refused_elsewhere(run / PROCESSES)
    if so_far is not None or read_removed(run):
        told["kept"] = kept_record(run, (told.get("config") or {}).get("keep"))
    heard = {} if so_far is None else so_far.heard
    told["ledger"] = {
        "telemetry": _telemetry(run, heard, torn=torn),
        **_rounds_and_jobs(run / RESULTS, (said.get("ledger") or {})),
    }
    can_be_none = (
        {"calibration", "plan_comparison", "side_by_side"} if so_far is not None else set()
    )
    windows = kept_rows(run / RESULTS, "windows", "round_id")
    can_be_none |= set() if windows else {"agreement"}
    unknown = [n for n in _TOLD_WHILE_DRIVING if told[n] is None and n not in can_be_none]
    unknown += [f"ledger.{name}" for name, of in told["ledger"].items() if of is None]
    unknown += [f"futures.{name}" for name in _OF_FUTURES if told["futures"].get(name) is None]
    return RecoveredRecord(told, tuple(unknown), said.get("drive_time_s"))


def _told_by_tables(run: Path, said: Mapping[str, Any]) -> dict[str, Any]:
    """Return the parts that follow from tables, of those that have all their parts."""
    results, gone = run / RESULTS, read_removed(run)
    counts = counted_in_tables(results)
    told: dict[str, Any] = {}
    told["futures"] = _futures(counts.futures, said)
    told["state_to_result_ms_p50"] = percentile(counts.futures.latencies_ms, 50)
    told["state_to_result_ms_p95"] = percentile(counts.futures.latencies_ms, 95)
    if "plan_comparisons.parquet" not in gone and counts.plans.rows.count:
        told["plan_comparison"] = counts.plans.record()
    if "forecasts.parquet" not in gone and counts.forecasts.rows.count:
        told["calibration"] = counts.forecasts.record()
    chosen = ((said.get("config") or {}).get("siblings")) or {}
    told["siblings"] = counts.siblings.record(msgspec.convert(chosen, Siblings))
    if "junctions.parquet" not in gone:
        told["intersections"] = visited_junctions(results).records
    mirror = kept_rows(results, "mirror", "independent")
    if mirror and "comparisons.parquet" not in gone:
        independent = any(row["independent"] for row in mirror)
        told["comparison"] = counts.comparisons.record(independent=independent)
    if "rounds.parquet" in gone and said.get("futures"):
        told = {name: said.get(name) for name in told}
    times_s = [s for s in (counts.last_round_s, said.get("drive_time_s")) if s is not None]
    return told | {"drive_time_s": round(max(times_s), 3) if times_s else None}


def _futures(counted: FuturesCount, said: Mapping[str, Any]) -> dict[str, Any]:
    wanted = (said.get("config") or {}).get("futures")
    told = counted.record(wanted=wanted or 0, missed=0, spared=0, unseeded=0)
    if wanted is None:
        told |= {"wanted_per_round": None, "smaller_rounds": None}
    before = said.get("futures") or {}
    return told | {name: before.get(name) for name in _OF_FUTURES}


def _telemetry(run: Path, heard: Mapping[str, int], *, torn: bool) -> dict[str, Any] | None:
    """Return the ledger of the telemetry; None where nobody recorded anything."""
    recording = run / DRIVE_FILE
    if not tally_file(recording).exists():
        return None
    whole = torn and DRIVE_FILE not in read_removed(run)
    return telemetry_ledger(tally_left(recording, no_more_than_held=whole), heard)


def _rounds_and_jobs(results: Path, said: Mapping[str, Any]) -> dict[str, Any]:
    """Return the ledgers of rounds and jobs: as told last, and on with what came to the tables."""
    if not said:
        return {"rounds": None, "jobs": None}
    rounds = msgspec.convert(said["rounds"], RoundsLedger)
    jobs = msgspec.convert(said["jobs"], JobsLedger)
    if not read_removed(results.parent):
        rounds = rounds.known_to_have_run(len(kept_rows(results, "rounds", "round_id")))
        jobs = jobs.known_to_have_results(len(kept_rows(results, "jobs", "round_id")))
    return {
        "rounds": msgspec.to_builtins(rounds.ended()),
        "jobs": msgspec.to_builtins(jobs.ended()),
    }
