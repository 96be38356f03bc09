"""Indicators over many drives: what happened in each, how much was driven, what both come to.

In the manner of the safety performance indicators of ANSI/UL 4600. That standard was not read; what
such an indicator is was taken from Koopman and Kane, A More Precise Definition for ANSI/UL 4600
Safety Performance Indicators (Safe Autonomy, June 2021): a metric from evidence, and a threshold
which conditions a claim of a safety case. These are the metrics; thresholds are whose claims they
are.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Literal, NamedTuple

import msgspec

from foretwin.contracts.errors import UserError
from foretwin.orchestrator.occurred.occurred import Occurred, occurred_in
from foretwin.orchestrator.report.indicator_statistics import (
    LEVEL,
    CountedEvents,
    Trend,
    adjusted_p,
    change_p,
    rate_of,
    share_of,
    trend_of,
)
from foretwin.orchestrator.report.material import (
    RunMaterial,
    TableRow,
    changes_of_driver,
    in_lock_step,
    part_of,
)
from foretwin.sim_worker.analysis.occurred.conflicts import conflicts_of
from foretwin.sim_worker.analysis.occurred.odd import DrivenSpan, OddExposure
from foretwin.sim_worker.analysis.occurred.rows import THRESHOLDS

ExposureUnit = Literal["km", "h", "pass", "trial"]
"""What events are held against; of trials the events are a share."""
_STAMPED = re.compile(r"\d{8}-\d{6}-")
_CONFLICT, _TAKEOVERS = "conflicts", "takeovers"
_NAMES = {"ttc_s": "TTC", "pet_s": "PET", "drac_mps2": "DRAC"}
_UNSEEN = "unknown"


class IndicatorKey(NamedTuple):
    """What is counted, what it is held against, and at which kind of junction; "" anywhere."""

    name: str
    unit: ExposureUnit
    junction_kind: str = ""


class Indicator(msgspec.Struct, frozen=True, kw_only=True):
    """One indicator over many drives.

    `value`, `low` and `high` are events per `unit` with the exact 95 % interval, of trials a share
    from 0 to 1; None where none of the drives can tell.
    """

    name: str
    unit: ExposureUnit
    junction_kind: str
    drives: int
    """That can tell, of those given."""
    events: int
    exposure: float
    value: float | None
    low: float | None
    high: float | None
    p_value: float | None
    """That the later half of drives is as the earlier, adjusted for how many are asked (Holm)."""
    trend: Trend | None
    """Only where that is below 0.05."""


class CoveredForecasts(msgspec.Struct, frozen=True, kw_only=True):
    """How many of all forecasts came between p10 and p90, of which 0.8 is right.

    Forecasts overlap in time, and depend on each other: no interval is given.
    """

    drives: int
    forecasts: int
    coverage: float | None


class DriveIndicators(msgspec.Struct, frozen=True, kw_only=True):
    """Indicators over many drives, and what has to be known to read them."""

    drives: int
    indicators: tuple[Indicator, ...]
    calibration: CoveredForecasts
    replays: int
    """Drives that replay a recording which another one replays as well: what happened in it counts
    again."""
    in_order: bool
    """Whether the ids of all runs tell when they began; else there is no trend."""


def indicators_over(runs: Iterable[RunMaterial]) -> DriveIndicators:
    """Return the indicators of runs, each counted once, in the order in which they began."""
    once: dict[str, RunMaterial] = {}
    for run in runs:
        once.setdefault(_id(run), run)
    ordered = [once[name] for name in sorted(once)]
    in_order = all(_STAMPED.match(name) for name in once)
    counted = [
        counted_in(
            run.record, _occurred(run), row_counts(run.rows("driven_segments"), run.rows("marks"))
        )
        for run in ordered
    ]
    keys = dict.fromkeys(key for one in counted for key in one)
    series = {key: [one[key] for one in counted if key in one] for key in sorted(keys, key=_place)}
    p_values = adjusted_p(
        [
            change_p(drives, share=key.unit == "trial") if in_order else None
            for key, drives in series.items()
        ]
    )
    found = (
        _indicator(key, drives, p)
        for (key, drives), p in zip(series.items(), p_values, strict=True)
    )
    return DriveIndicators(
        drives=len(ordered),
        indicators=tuple(found),
        calibration=_covered([run.record for run in ordered]),
        replays=_replays([run.record for run in ordered]),
        in_order=in_order,
    )


class RowCounts(NamedTuple):
    """What tables of a run tell: events marked, and takeovers, None where no software drove."""

    marked: int
    takeovers: int | None


def counted_in(
    record: Mapping[str, Any], occurred: Occurred | None, rows: RowCounts
) -> dict[IndicatorKey, CountedEvents]:
    """Return what happened in a drive with its exposure; what it cannot tell is left out."""
    found: dict[IndicatorKey, CountedEvents] = {}
    if occurred is not None:
        span = next((one for one in occurred.odd if not one.junctions), None)
        parts = [one for one in occurred.odd if span and one.attribute == span.attribute]
        driven = _exposures(parts)
        by_software = _exposures([occurred.by_software] if occurred.by_software else ())
        for name, events in _happened(record, occurred, rows).items():
            for unit, exposure in (by_software if name == _TAKEOVERS else driven).items():
                found[IndicatorKey(name, unit)] = CountedEvents(events, exposure)
        found |= _by_junction_kind(record, occurred)
    return found | _shares(record)


def _exposures(parts: Sequence[OddExposure | DrivenSpan]) -> dict[ExposureUnit, float]:
    return {
        "km": sum(one.driven_m for one in parts) / 1e3,
        "h": sum(one.driven_s for one in parts) / 3600.0,
    }


def _happened(record: Mapping[str, Any], occurred: Occurred, rows: RowCounts) -> dict[str, int]:
    found = {"marked events": rows.marked}
    if occurred.sees_others:
        found[_CONFLICT] = len(conflicts_of(occurred.scenarios))
        for one in THRESHOLDS:
            met = conflicts_of(occurred.scenarios, by=one)
            found[f"{_CONFLICT} by {_NAMES.get(one, one)}"] = len(met)
    if rows.takeovers is not None:
        found[_TAKEOVERS] = rows.takeovers
    alarms = part_of(record, "tuning", "gap", "alarms")
    verdicts = part_of(record, "tuning", "verdicts")
    if alarms is not None:
        found["alarms of the gap"] = alarms
    if verdicts is not None:
        found["verdicts"] = len(verdicts)
    return found


def _by_junction_kind(
    record: Mapping[str, Any], occurred: Occurred
) -> dict[IndicatorKey, CountedEvents]:
    """Return conflicts at junctions, by their kind, held against how often such were passed."""
    if not occurred.sees_others:
        return {}
    kinds = {str(one["id"]): str(one["kind"]) for one in record.get("intersections") or ()}
    ways = (one for one in occurred.scenarios if not one.other_id)
    passes, met = (
        Counter(kinds.get(one.junction_id, _UNSEEN) for one in rows if one.junction_id)
        for rows in (ways, conflicts_of(occurred.scenarios))
    )
    return {
        IndicatorKey(_CONFLICT, "pass", kind): CountedEvents(met[kind], float(count))
        for kind, count in passes.items()
        if count
    }


_SHARES = (
    ("rounds too late", ("futures", "late_rounds"), ("futures", "rounds")),
    ("rounds missed", ("ledger", "rounds", "missed"), ("ledger", "rounds", "due")),
    ("telemetry lost", ("ledger", "telemetry", "lost"), ("ledger", "telemetry", "published")),
    ("jobs lost", ("ledger", "jobs", "lost"), ("ledger", "jobs", "given")),
)
"""Of trials: what, how many, and of how many, as `run.json` has it."""


_OF_ROUNDS = frozenset({"rounds too late", "rounds missed"})
"""What a drive in lock step cannot tell: it waits for its rounds."""


def _shares(record: Mapping[str, Any]) -> dict[IndicatorKey, CountedEvents]:
    waited = in_lock_step(record)
    told = {name: (part_of(record, *of), part_of(record, *trials)) for name, of, trials in _SHARES}
    return {
        IndicatorKey(name, "trial"): CountedEvents(events, float(trials))
        for name, (events, trials) in told.items()
        if events is not None and trials and not (waited and name in _OF_ROUNDS)
    }


def _indicator(
    key: IndicatorKey, drives: Sequence[CountedEvents], p_value: float | None
) -> Indicator:
    events, exposure = sum(one.events for one in drives), sum(one.exposure for one in drives)
    share = key.unit == "trial"
    found = share_of(events, round(exposure)) if share else rate_of(events, exposure)
    return Indicator(
        name=key.name,
        unit=key.unit,
        junction_kind=key.junction_kind,
        drives=len(drives),
        events=events,
        exposure=exposure,
        value=None if found is None else found.value,
        low=None if found is None else found.low,
        high=None if found is None else found.high,
        p_value=p_value,
        trend=trend_of(drives) if p_value is not None and p_value < LEVEL else None,
    )


def _covered(records: Iterable[Mapping[str, Any]]) -> CoveredForecasts:
    told = [one for record in records if (one := record.get("calibration")) and one.get("count")]
    count = sum(one["count"] for one in told)
    within = sum(one["p10_p90_coverage"] * one["count"] for one in told)
    return CoveredForecasts(
        drives=len(told), forecasts=count, coverage=within / count if count else None
    )


def _replays(records: Iterable[Mapping[str, Any]]) -> int:
    logs = Counter(part_of(record, "config", "log") for record in records)
    return sum(count for log, count in logs.items() if log and count > 1)


def _occurred(run: RunMaterial) -> Occurred | None:
    try:
        return occurred_in(run.folder, recorded=run.recorded)
    except (UserError, OSError):
        return None


def row_counts(segments: Sequence[TableRow], marks: Sequence[TableRow]) -> RowCounts:
    """Return what rows of `driven_segments` and `marks` come to: a note that came later is a row
    of its own, and what the human takes over is what the software drove."""
    by_software = any(one["control_mode"] == "autonomous" for one in segments)
    return RowCounts(
        marked=len({one["mark_id"] for one in marks}),
        takeovers=changes_of_driver(segments, to="manual") if by_software else None,
    )


def _id(run: RunMaterial) -> str:
    return str(run.record.get("run_id") or run.folder.resolve().name)


def _place(key: IndicatorKey) -> tuple[int, str, str, str]:
    """Return where an indicator stands: conflicts, other events, then shares."""
    rank = 2 if key.unit == "trial" else 0 if key.name.startswith(_CONFLICT) else 1
    return rank, key.name, key.junction_kind, key.unit
