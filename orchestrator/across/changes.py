"""What changed from one run or sweep to another: by case, by measure and by place."""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Sequence
from typing import Any

import numpy as np

from foretwin.contracts.errors import UserError
from foretwin.orchestrator.across.paired_statistics import (
    LEVEL,
    PairedChange,
    adjusted,
    paired_change,
)
from foretwin.orchestrator.across.pairs import ComparedSide, paired
from foretwin.orchestrator.across.run_rows import DRIVE
from foretwin.sim_worker.metrics.table import METRICS

_ALWAYS = {"min_clearance_m": ("m", "higher"), "progress_m": ("m", "higher")}
_METRIC = "metric_"
_INPUTS = "config", "spec", "planners", "versions", "map"
"""Of a record: what decides what it came to."""
_OF_NO_MATTER = frozenset({"out", "view", "workers", "cache_dir", "job_timeout_s"})
Pair = tuple[dict[str, Any], dict[str, Any]]


def changes_between(first: ComparedSide, second: ComparedSide) -> dict[str, Any]:
    """Return what changed from the first to the second, as an object that JSON holds.

    A case fails where its future collides. `failing` counts cases that were played on both sides;
    `measures` are of those in which both have a value, `alone` counts those in which one side has.
    p values are over places, None where these are too few; those of `measures` and `alone` are
    adjusted for how many of them there are.
    Raises UserError where both sides have no case in common.
    """
    if first.row.kind != second.row.kind:
        kinds = f"{first.row.folder} is a {first.row.kind}, {second.row.folder} a {second.row.kind}"
        raise UserError(f"compare: {kinds}: two of a kind are compared")
    found = paired(first, second)
    if not found.pairs:
        raise UserError(
            f"compare: {first.row.folder} and {second.row.folder} have no case in common: "
            + (
                "drives are compared by the instants of one recording at which both began futures"
                if first.row.kind == DRIVE
                else "sweeps are compared by junction, scenario, case, numbers and seed"
            )
        )
    played = [pair for pair in found.pairs if all(_played(row) for row in pair)]
    other = [pair for pair in found.pairs if not all(_played(row) for row in pair)]
    return {
        "first": _told(first),
        "second": _told(second),
        "inputs": _inputs(first, second),
        "pairs": len(found.pairs),
        "only_first": found.only_first,
        "only_second": found.only_second,
        "equal": sum(a["trajectory_sha256"] == b["trajectory_sha256"] for a, b in played),
        "not_played": {
            "newly": sum(_played(a) for a, _ in other),
            "no_longer": sum(_played(b) for _, b in other),
            "neither": sum(not _played(a) and not _played(b) for a, b in other),
        },
        "failing": _failing(played),
        "measures": _measures(played, first, second),
        "alone": _alone(played, first, second),
        "places": _places(played),
        "newly_failing": [_case(b) for a, b in played if b["collided"] and not a["collided"]],
        "fixed": [_case(b) for a, b in played if a["collided"] and not b["collided"]],
    }


def is_worse(found: dict[str, Any]) -> bool:
    """Whether more of these cases newly fail than were fixed: what `--fail-on-worse` asks.

    The same cases are played on both sides, and without chance: that is a fact about them, at one
    place as at many, and says nothing of other places.
    """
    failing = found["failing"]
    return bool(failing["newly"] > failing["fixed"])


def _played(row: dict[str, Any]) -> bool:
    return bool(row["valid"]) and not row["failure"] and not row["left_out"]


def _failing(played: Sequence[Pair]) -> dict[str, Any]:
    counts = _counts(played)
    if not played:
        return {**counts, "p_value": None, "change": None}
    differences = np.array([float(b["collided"]) - float(a["collided"]) for a, b in played])
    change = paired_change(differences, [a["junction_id"] for a, _ in played])
    return {**counts, "p_value": change.p_value, "change": change._asdict()}


def _counts(played: Sequence[Pair]) -> dict[str, int]:
    return {
        "pairs": len(played),
        "first": sum(bool(a["collided"]) for a, _ in played),
        "second": sum(bool(b["collided"]) for _, b in played),
        "newly": sum(bool(b["collided"]) and not a["collided"] for a, b in played),
        "fixed": sum(bool(a["collided"]) and not b["collided"] for a, b in played),
    }


def _measures(
    played: Sequence[Pair], first: ComparedSide, second: ComparedSide
) -> list[dict[str, Any]]:
    """Return each measure that both sides have, over the pairs in which both have a value."""
    rows: list[dict[str, Any]] = []
    for name, (unit, better) in _meaning(first, second):
        both = [(a, b) for a, b in played if _number(a.get(name)) and _number(b.get(name))]
        if not both:
            continue
        before, after = (np.array([pair[side][name] for pair in both]) for side in (0, 1))
        change = paired_change(after - before, [a["junction_id"] for a, _ in both])
        rows.append(
            {
                "measure": name,
                "unit": unit,
                "better": better,
                "pairs": len(both),
                "first": float(np.mean(before)),
                "second": float(np.mean(after)),
                "change": change._asdict(),
                "relative": _is_relative(name),
                "word": _word(change, better),
            }
        )
    for row in _with_adjusted(rows, [row["change"]["p_value"] for row in rows]):
        p_value = row["p_adjusted"]
        if row["change"]["mean"] == 0.0:
            row["word"] = "the same"
        elif p_value is None or p_value >= LEVEL:
            row["word"] = "too few places" if p_value is None else "not significant"
    return rows


def _alone(
    played: Sequence[Pair], first: ComparedSide, second: ComparedSide
) -> list[dict[str, Any]]:
    """Return each measure that one side alone has a value of in some pairs: nothing is infinite in
    a table, so that a mean of both says nothing of who was never near anybody before."""
    rows: list[dict[str, Any]] = []
    for name, _ in _meaning(first, second):
        has = [(_number(a.get(name)), _number(b.get(name))) for a, b in played]
        counts = {
            "first": sum(a and not b for a, b in has),
            "second": sum(b and not a for a, b in has),
            "both": sum(a and b for a, b in has),
        }
        if counts["first"] or counts["second"]:
            oftener = np.array([float(b) - float(a) for a, b in has])
            change = paired_change(oftener, [a["junction_id"] for a, _ in played])
            told = {"p_value": change.p_value, "units": change.units}
            rows.append({"measure": name, **counts, **told})
    return _with_adjusted(rows, [row["p_value"] for row in rows])


def _meaning(first: ComparedSide, second: ComparedSide) -> list[tuple[str, tuple[str, str]]]:
    """Return the measures of both sides by name, with their units and which direction is better."""
    both = first.units.keys() & second.units.keys()
    metrics = {_METRIC + name: (second.units[name], second.better[name]) for name in both}
    return sorted((_ALWAYS | metrics).items())


def _with_adjusted(
    rows: list[dict[str, Any]], p_values: Sequence[float | None]
) -> list[dict[str, Any]]:
    for row, of_many in zip(rows, adjusted(p_values), strict=True):
        row["p_adjusted"] = of_many
    return rows


def _is_relative(name: str) -> bool:
    known = METRICS.get(name.removeprefix(_METRIC))
    return known is not None and known.relative


def _word(change: PairedChange, better: str) -> str:
    if better == "neither":
        return "changed"
    return "better" if (change.mean > 0.0) == (better == "higher") else "worse"


def _number(value: Any) -> bool:
    return value is not None and bool(np.isfinite(value))


def _places(played: Sequence[Pair]) -> list[dict[str, Any]]:
    """Return each place, those first where most changed for the worse."""
    at: dict[str, list[Pair]] = defaultdict(list)
    for pair in played:
        at[pair[0]["junction_id"]].append(pair)
    rows = [{"junction_id": junction_id, **_counts(pairs)} for junction_id, pairs in at.items()]
    return sorted(rows, key=lambda row: (row["fixed"] - row["newly"], row["junction_id"]))


def _case(row: dict[str, Any]) -> dict[str, Any]:
    names = "future_id", "junction_id", "scenario", "name", "planner", "case", "stamp_ns"
    return {name: row.get(name) for name in names}


def _told(side: ComparedSide) -> dict[str, Any]:
    row = side.row
    planners = side.planners
    told = {"run": row.run, "folder": row.folder, "kind": row.kind, "foretwin": row.foretwin}
    return {**told, "futures": len(side.futures), "planners": planners}


def _inputs(first: ComparedSide, second: ComparedSide) -> dict[str, Any]:
    """Return what decides the futures and is another on both sides, by its dotted name."""
    a, b = (json.loads(side.row.record) for side in (first, second))
    found: dict[str, Any] = {}
    for name in _INPUTS:
        mine, theirs = (one.get(name) or {} for one in (a, b))
        for key in sorted(mine.keys() | theirs.keys()):
            if mine.get(key) != theirs.get(key) and key not in _OF_NO_MATTER:
                found[f"{name}.{key}"] = {"first": mine.get(key), "second": theirs.get(key)}
    if first.planners != second.planners:
        found["planner"] = {"first": first.planners, "second": second.planners}
    if a.get("seed") != b.get("seed"):
        found["seed"] = {"first": a.get("seed"), "second": b.get("seed")}
    return found
