"""What came of a sweep, by scenario and planner."""

from __future__ import annotations

import collections
import hashlib
import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import msgspec

from foretwin.contracts.parts import CaseCount
from foretwin.contracts.running import OTHER_REASONS, RunningQuantiles, with_others
from foretwin.contracts.terminal import console, plain, say, words
from foretwin.orchestrator.sweep.manifest import PartEntry
from foretwin.orchestrator.sweep.spec import SweepSpec
from foretwin.sim_worker.road_users.likeness import likeness_words

_SCORE = "driving_score"
COUNTS = ("cases", "placed", "played", "collided", "failed")
"""What is counted of each scenario and planner."""
_SHOWN = ("cases", "played", "collided", "failed")
_REASONS = 1000
"""So many different ones are counted of each."""


class _CaseSums:
    def __init__(self) -> None:
        self.cases = self.placed = self.played = self.collided = self.failed = 0
        self.clearance_m = RunningQuantiles()
        self.scores, self.scored = 0.0, 0
        self.reasons: collections.Counter[str] = collections.Counter()
        self.not_placed: collections.Counter[str] = collections.Counter()
        self.not_placed_rows = 0

    def add(self, count: CaseCount) -> None:
        told = msgspec.structs.asdict(count)
        told["played"] = played_of(told)
        for name in COUNTS:
            setattr(self, name, getattr(self, name) + told[name])
        for clearance_m in count.clearance_m:
            self.clearance_m.take(clearance_m)
        self.scores = math.fsum((self.scores, *count.scores))
        self.scored += len(count.scores)
        self.not_placed_rows += sum(count.not_placed.values())
        for mine, theirs in ((self.reasons, count.reasons), (self.not_placed, count.not_placed)):
            known = {why: n for why, n in theirs.items() if why in mine or len(mine) < _REASONS}
            mine.update(known)


class Summary:
    """Adds up what came of parts, in memory that does not grow with them."""

    def __init__(self, spec: SweepSpec) -> None:
        self._scored = _SCORE in spec.metrics
        self._groups: dict[tuple[str, str], _CaseSums] = collections.defaultdict(_CaseSums)

    def add(self, count: CaseCount) -> None:
        """Count what came of more cases."""
        self._groups[count.scenario, count.planner].add(count)

    def totals(self) -> dict[str, int]:
        """Return the counts of all rows."""
        groups = self._groups.values()
        cases, *others = (sum(getattr(group, name) for group in groups) for name in COUNTS)
        return {"rows": cases, **dict(zip(COUNTS[1:], others, strict=True))}

    def table(self) -> list[dict[str, Any]]:
        """Return one entry for each scenario and planner."""
        return [
            {
                "scenario": scenario,
                "planner": planner,
                **{name: getattr(group, name) for name in COUNTS},
                "median_clearance_m": _rounded(group.clearance_m.percentile(50.0)),
                "mean_score": _rounded(
                    group.scores / group.scored if self._scored and group.scored else None
                ),
                "scored": group.scored,
                "reasons": _most(group.reasons),
                "not_placed": _most(group.not_placed),
                "not_placed_rows": group.not_placed_rows,
            }
            for (scenario, planner), group in sorted(self._groups.items())
        ]


def played_of(entry: Mapping[str, Any]) -> int:
    """Return how many cases of an entry of `scenarios` were played to their end: what collided is
    a share of these.

    Of a sweep from before that was counted, those that neither failed nor were left out.
    """
    if (told := entry.get("played")) is not None:
        return int(told)
    left_out = entry.get("not_placed_rows", sum(entry["not_placed"].values()))
    rest: int = min(entry["placed"], entry["cases"] - entry["failed"] - left_out)
    return max(0, rest)


def summed(spec: SweepSpec, entries: Iterable[PartEntry]) -> dict[str, Any]:
    """Return what the listed parts of a sweep come to, in the order of their jobs."""
    digest, counted = hashlib.sha256(), Summary(spec)
    for entry in entries:
        digest.update(bytes.fromhex(entry.rows_sha256))
        for count in entry.counts:
            counted.add(count)
    return {
        **counted.totals(),
        "rows_sha256": digest.hexdigest(),
        "scenarios": counted.table(),
    }


def _most(reasons: collections.Counter[str]) -> dict[str, int]:
    """Return the three most frequent, whoever counted them first."""
    return dict(sorted(reasons.items(), key=lambda one: (-one[1], one[0]))[:3])


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(value, 4)


def _counted(summary: dict[str, Any]) -> str:
    rows, nowhere = summary["rows"], len(summary["unplaced"])
    not_placed = sum(entry["not_placed_rows"] for entry in summary["scenarios"])
    return (
        f"{rows} rows of {summary['worlds']} Worlds"
        f"{f', {not_placed} of them not placed' if not_placed else ''}, "
        f"{summary['jobs_played']} of {summary['jobs']} jobs played now in "
        f"{summary['playing_s']:.1f} s"
        f"{f'; places not found: {nowhere}' if nowhere else ''}"
    )


def _not_placed_lines(entries: list[dict[str, Any]]) -> list[str]:
    """Return how many rows of each scenario, by all planners, were not placed for which reason."""
    counted: dict[str, collections.Counter[str]] = collections.defaultdict(collections.Counter)
    for entry in entries:
        told = with_others(entry["not_placed"], entry["not_placed_rows"])
        counted[entry["scenario"]].update(told)
    return [
        f"not placed: {count} row{'s' if count != 1 else ''} of {scenario}: {reason}"
        for scenario, reasons in counted.items()
        for reason, count in sorted(
            reasons.items(), key=lambda one: (one[0] == OTHER_REASONS, -one[1])
        )
    ]


def _no_place_lines(unplaced: list[Any]) -> list[str]:
    """Return at how many junctions, or Worlds, each scenario has no place, for which reason."""
    counted: dict[str, collections.Counter[str]] = collections.defaultdict(collections.Counter)
    for one in map(msgspec.to_builtins, unplaced):
        counted[one["scenario_id"]][one["reason"]] += 1
    lines = []
    for scenario, reasons in sorted(counted.items()):
        lines += [
            f"no place: {count} junction{'s' if count != 1 else ''} for {scenario}: {reason}"
            for reason, count in with_others(_most(reasons), reasons.total()).items()
        ]
    return lines


def _of(entry: dict[str, Any]) -> str:
    return "" if entry["scored"] == entry["played"] else f" of {entry['scored']}"


def print_summary(out: Path, summary: dict[str, Any]) -> None:
    """Print a sweep's summary as a table."""
    from rich.table import Column, Table

    named = (Column(name, no_wrap=True) for name in ("scenario", "planner"))
    numbers = (*_SHOWN, "median clearance", "mean score")
    table = Table(*named, *(Column(name, justify="right", no_wrap=True) for name in numbers))
    for entry in summary["scenarios"]:
        clearance, score = entry["median_clearance_m"], entry["mean_score"]
        table.add_row(
            words(entry["scenario"]),
            words(entry["planner"]),
            *(str(entry[name]) for name in _SHOWN),
            "" if clearance is None else f"{clearance:.2f} m",
            "" if score is None else f"{score:.3f}{_of(entry)}",
        )
    console().print(table)
    shard = f", shard {summary['shard']}" if "shard" in summary else ""
    say(f"{out}{shard}: {_counted(summary)}")
    say(likeness_words())
    if summary["placed_nowhere"]:
        say(f"placed nowhere: {', '.join(summary['placed_nowhere'])}")
    for place, reason in summary["failures"].items():
        say(plain(f"failed: {place}: {reason}"))
    for entry in summary["scenarios"]:
        for reason, count in entry["reasons"].items():
            say(plain(f"failed: {count} of {entry['scenario']} by {entry['planner']}: {reason}"))
    for line in (*_no_place_lines(summary["unplaced"]), *_not_placed_lines(summary["scenarios"])):
        say(plain(line))
    say(f"sha256 of the rows: {summary['rows_sha256']}")
    say(summary["attribution"])
