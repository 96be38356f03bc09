"""What came of a sweep: counts by scenario and planner, and why cases were not placed."""

from __future__ import annotations

import statistics
from pathlib import Path

import pytest
from msgspec.structs import replace

from foretwin.contracts.parts import CaseCount
from foretwin.orchestrator.sweep.spec import load_spec
from foretwin.orchestrator.sweep.summary import Summary, print_summary
from tests.orchestrator.sweeps import small_sweep

COUNT = CaseCount(scenario="scp", planner="x", cases=10, placed=9, collided=0, failed=0)


def test_reasons_are_added_up_and_the_most_frequent_told(tmp_path: Path) -> None:
    summary = Summary(load_spec(small_sweep(tmp_path)).spec)
    for reasons in ({"too short": 1, "built over": 2}, {"too short": 1, "a": 1, "b": 1}):
        summary.add(replace(COUNT, not_placed=reasons))
    (entry,) = summary.table()
    assert list(entry["not_placed"].items()) == [("built over", 2), ("too short", 2), ("a", 1)]
    assert (entry["cases"], entry["placed"]) == (20, 18)


def test_in_whatever_order_parts_come_they_add_up_to_the_same(tmp_path: Path) -> None:
    spec = load_spec(small_sweep(tmp_path)).spec
    parts = [
        replace(
            COUNT, clearance_m=(float(n), n / 3.0), scores=(1.0 / (n + 1),), reasons={str(n): 1}
        )
        for n in range(50)
    ]
    forwards, backwards = Summary(spec), Summary(spec)
    for part, other in zip(parts, reversed(parts), strict=True):
        forwards.add(part)
        backwards.add(other)
    assert forwards.table() == backwards.table()
    (entry,) = forwards.table()
    values = [value for part in parts for value in part.clearance_m]
    assert entry["median_clearance_m"] == round(statistics.median(values), 4)
    scores = [score for part in parts for score in part.scores]
    assert entry["mean_score"] == round(statistics.fmean(scores), 4)
    assert forwards.totals() == {"rows": 500, "placed": 450, "collided": 0, "failed": 0}


@pytest.mark.parametrize(
    ("placed", "unplaced", "said"),
    [
        (8, [], "8 rows of 3 Worlds, 4 of 4 jobs played now in 0.6 s"),
        (4, [], "8 rows of 3 Worlds, 4 of them not placed, 4 of 4 jobs played now in 0.6 s"),
        (8, [{}], "in 0.6 s; places not found: 1"),
    ],
)
def test_the_last_line_counts_what_was_not_placed(
    placed: int, unplaced: list[dict[str, str]], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    counts = {"rows": 8, "placed": placed, "worlds": 3, "jobs": 4, "jobs_played": 4}
    told = {"playing_s": 0.552, "unplaced": unplaced, "placed_nowhere": [], "failures": {}}
    more = {"scenarios": [], "rows_sha256": "0", "attribution": ""}
    print_summary(Path("out"), counts | told | more)
    assert said in capsys.readouterr().out
