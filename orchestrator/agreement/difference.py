"""Two runs of the same drive: what changes in disagreements, gap and outcomes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from foretwin.orchestrator.record.table_parts import read_parts

SAME_NS = 1_000_000_000
"""Disagreements of one kind that begin so near to each other are the same."""
_SAME_WINDOW_NS = 250_000_000


class JudgedRun(NamedTuple):
    """What is compared of a run: its record, and rows of its tables."""

    folder: Path
    record: dict[str, Any]
    agreement: list[dict[str, Any]]
    gap_m: list[float]


def read_judged(folder: Path) -> JudgedRun:
    """Read a run's folder; raises FileNotFoundError for one without its tables."""
    record = json.loads((folder / "run.json").read_text(encoding="utf-8"))
    rows: list[dict[str, Any]] = read_parts(folder / "results/agreement.parquet").to_pylist()
    gaps = read_parts(folder / "results/mirror.parquet", columns=["gap_m"])
    return JudgedRun(folder, record, rows, gaps["gap_m"].to_pylist())


def difference_of(before: JudgedRun, after: JudgedRun) -> dict[str, Any]:
    """Return what changes from one run of a drive to another."""
    return {
        "before": _run_of(before),
        "after": _run_of(after),
        "disagreements": _disagreements(before.record, after.record),
        "gap": {
            "nominal_ade_m": _both(before, after, lambda run: run.record["comparison"]["ade_m"]),
            "twin_gap_p95_m": _both(before, after, _gap_p95_m),
        },
        "agreement": _both(
            before, after, lambda run: (run.record["agreement"] or {}).get("overall")
        ),
        "outcomes": _outcomes(before.agreement, after.agreement),
        "junctions": _junctions(before.record, after.record),
        "off_road": _both(before, after, lambda run: len(run.record["off_road"])),
    }


def difference_lines(found: dict[str, Any]) -> list[str]:
    """Return the difference for people."""
    lines = [
        f"{side}: {found[side]['run']} ({_inputs(found[side])})" for side in ("before", "after")
    ]
    apart = found["disagreements"]
    lines.append(
        f"disagreements of human and ADS: {apart['same']} the same, {len(apart['gone'])} gone, "
        f"{len(apart['new'])} new"
    )
    for sign, name in (("-", "gone"), ("+", "new")):
        lines += [
            f"  {sign} {one['drive_time_s']:.1f} s {one['kind']} at {one['lat_deg']:.6f}, "
            f"{one['lon_deg']:.6f}"
            for one in apart[name]
        ]
    gap = found["gap"]
    ade = gap["nominal_ade_m"]
    for horizon in sorted(ade["before"].keys() | ade["after"].keys(), key=float):
        lines.append(f"nominal future, ADE at {horizon} s: {_pair(ade, horizon)} m")
    lines.append(f"gap of the twin, 95th percentile: {_pair(gap['twin_gap_p95_m'])} m")
    if found["agreement"]["before"] and found["agreement"]["after"]:
        lines += [
            f"{name.replace('_', ' ')}: {_pair(found['agreement'], name)} windows"
            for name in found["agreement"]["before"]
        ]
    lines.append(f"verdicts that change: {len(found['outcomes'])}")
    lines += [
        f"  {one['drive_time_s']:.1f} s at {one['junction_id']}: {_verdict(one['before'])} → "
        f"{_verdict(one['after'])}"
        for one in found["outcomes"]
    ]
    junctions = found["junctions"]
    for sign, name in (("-", "gone"), ("+", "new")):
        lines += [f"junction {sign} {one}" for one in junctions[name]]
    lines.append(f"stretches where the map allows no car: {_pair(found['off_road'])}")
    return lines


def _inputs(run: dict[str, Any]) -> str:
    named = {"map": run["map"], "vehicle": run.get("vehicle"), "Worlds of": run.get("worlds")}
    return ", ".join(f"{what} {given}" for what, given in named.items() if given)


def _run_of(run: JudgedRun) -> dict[str, Any]:
    config = run.record["config"]
    corrected = {"vehicle": config["vehicle"], "worlds": config.get("worlds")}
    return {"run": str(run.folder), "map": run.record["map"]["file"], **corrected}


def _both(before: JudgedRun, after: JudgedRun, of: Any) -> dict[str, Any]:
    return {"before": of(before), "after": of(after)}


def _gap_p95_m(run: JudgedRun) -> float | None:
    return round(float(np.percentile(run.gap_m, 95.0)), 4) if run.gap_m else None


def _disagreements(before: dict[str, Any], after: dict[str, Any]) -> dict[str, Any]:
    old = list((before["side_by_side"] or {}).get("disagreements", ()))
    new = []
    same = 0
    for one in (after["side_by_side"] or {}).get("disagreements", ()):
        match = next((o for o in old if _is_same(o, one)), None)
        if match is None:
            new.append(one)
        else:
            old.remove(match)
            same += 1
    return {"same": same, "gone": old, "new": new}


def _is_same(one: dict[str, Any], other: dict[str, Any]) -> bool:
    near = abs(one["stamp_ns"] - other["stamp_ns"]) <= SAME_NS
    return near and (one["aspect"], one["kind"]) == (other["aspect"], other["kind"])


def _outcomes(before: list[dict[str, Any]], after: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the windows of the same time whose outcome, or what fails, is another one now."""
    told = ("outcome", "simulated_fails", "driven_fails", "observable", "not_observable")
    changed = []
    for one in after:
        near = [o for o in before if abs(o["stamp_ns"] - one["stamp_ns"]) <= _SAME_WINDOW_NS]
        if near and any(near[0][name] != one[name] for name in told[:3]):
            changed.append(
                {
                    "drive_time_s": one["drive_time_s"],
                    "stamp_ns": one["stamp_ns"],
                    "junction_id": one["intersection_id"],
                    "before": {name: near[0][name] for name in told},
                    "after": {name: one[name] for name in told},
                }
            )
    return changed


def _verdict(one: dict[str, Any]) -> str:
    unseen = one["not_observable"]
    return (
        f"{one['outcome']} (simulated fails {one['simulated_fails'] or 'nothing'}, driven "
        f"{one['driven_fails'] or 'nothing'}{f', not observable: {unseen}' if unseen else ''})"
    )


def _junctions(before: dict[str, Any], after: dict[str, Any]) -> dict[str, list[str]]:
    old = [f"{one['kind']} {one['name'] or one['id']}" for one in before["intersections"]]
    new = [f"{one['kind']} {one['name'] or one['id']}" for one in after["intersections"]]
    return {"gone": [o for o in old if o not in new], "new": [n for n in new if n not in old]}


def _pair(both: dict[str, Any], key: str | None = None) -> str:
    told = []
    for side in ("before", "after"):
        value = both[side] if key is None else both[side].get(key)
        told.append(
            "-" if value is None else f"{value:.3g}" if isinstance(value, float) else f"{value}"
        )
    return " → ".join(told)
