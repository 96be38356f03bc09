"""What came of a sweep, by scenario and planner."""

from __future__ import annotations

import collections
import statistics
from pathlib import Path
from typing import Any

from foretwin.contracts.terminal import console, plain, say, words
from foretwin.orchestrator.sweep.spec import SweepSpec
from foretwin.sim_worker.futures.future_rows import Row
from foretwin.sim_worker.road_users.likeness import likeness_words

_SCORE = "metric_driving_score"
COUNTS = ("cases", "placed", "collided", "failed")
"""What is counted of each scenario and planner."""
_PLAIN_WIDTH = 120


class _CaseCount:
    def __init__(self) -> None:
        self.cases = self.placed = self.collided = self.failed = 0
        self.clearance_m: list[float] = []
        self.scores: list[float] = []
        self.reasons: collections.Counter[str] = collections.Counter()
        self.not_placed: collections.Counter[str] = collections.Counter()

    def add(self, row: Row) -> None:
        self.cases += 1
        if row["failure"]:
            self.failed += 1
            self.reasons[row["failure"]] += 1
        if row["left_out"]:
            self.not_placed[row["left_out"]] += 1
        if row["left_out"] or row["trajectory_sha256"] is None:
            return
        self.placed += 1
        self.collided += bool(row["collided"])
        if row["min_clearance_m"] is not None:
            self.clearance_m.append(row["min_clearance_m"])
        if row.get(_SCORE) is not None:
            self.scores.append(row[_SCORE])


class Summary:
    """Counts rows; a case that cannot be played at its place is not placed."""

    def __init__(self, spec: SweepSpec) -> None:
        self._scored = _SCORE.removeprefix("metric_") in spec.metrics
        self._groups: dict[tuple[str, str], _CaseCount] = collections.defaultdict(_CaseCount)

    def add(self, row: Row) -> None:
        """Count one more row."""
        self._groups[row["scenario"], row["planner"]].add(row)

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
                "median_clearance_m": _rounded(group.clearance_m, statistics.median),
                "mean_score": _rounded(group.scores, statistics.fmean) if self._scored else None,
                "reasons": dict(group.reasons.most_common(3)),
                "not_placed": dict(group.not_placed.most_common(3)),
            }
            for (scenario, planner), group in sorted(self._groups.items())
        ]


def _rounded(values: list[float], reduce: Any) -> float | None:
    return round(float(reduce(values)), 4) if values else None


def print_summary(out: Path, summary: dict[str, Any]) -> None:
    """Print a sweep's summary as a table."""
    from rich.table import Column, Table

    named = (Column(name, no_wrap=True) for name in ("scenario", "planner"))
    numbers = (*COUNTS, "median clearance", "mean score")
    table = Table(*named, *(Column(name, justify="right", no_wrap=True) for name in numbers))
    for entry in summary["scenarios"]:
        clearance, score = entry["median_clearance_m"], entry["mean_score"]
        table.add_row(
            words(entry["scenario"]),
            words(entry["planner"]),
            *(str(entry[name]) for name in COUNTS),
            "" if clearance is None else f"{clearance:.2f} m",
            "" if score is None else f"{score:.3f}",
        )
    shown = console()
    if not shown.is_terminal:
        shown.width = _PLAIN_WIDTH  # A file or a pipe has no width of its own to keep to.
    shown.print(table)
    say(
        f"{out}: {summary['rows']} rows of {summary['worlds']} Worlds, {summary['jobs_played']} of "
        f"{summary['jobs']} jobs played now in {summary['playing_s']:.1f} s; "
        f"{len(summary['unplaced'])} unplaced"
    )
    say(likeness_words())
    if summary["placed_nowhere"]:
        say(f"placed nowhere: {', '.join(summary['placed_nowhere'])}")
    for place, reason in summary["failures"].items():
        say(plain(f"failed: {place}: {reason}"))
    for entry in summary["scenarios"]:
        for reason, count in entry["reasons"].items():
            say(plain(f"failed: {count} of {entry['scenario']} by {entry['planner']}: {reason}"))
    # Where a case can be played is the same for all planners.
    not_placed = {
        (entry["scenario"], reason): f"not placed: {count} of {entry['scenario']}: {reason}"
        for entry in summary["scenarios"]
        for reason, count in entry["not_placed"].items()
    }
    for line in not_placed.values():
        say(plain(line))
    say(f"sha256 of the rows: {summary['rows_sha256']}")
    say(summary["attribution"])
