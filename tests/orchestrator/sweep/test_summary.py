"""What came of a sweep: counts by scenario and planner, and why cases were not placed."""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import msgspec
import pytest
from msgspec.structs import replace

from foretwin.contracts.parts import CaseCount
from foretwin.contracts.placement import NotPlaced
from foretwin.orchestrator.sweep.spec import load_spec
from foretwin.orchestrator.sweep.summary import Summary, played_of, print_summary
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
    assert entry["scored"] == 50
    assert forwards.totals() == {
        "rows": 500, "placed": 450, "played": 450, "collided": 0, "failed": 0,
    }  # fmt: skip


def test_what_failed_is_not_among_those_played(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Sixty of a hundred fail, fifteen of them where others collide: 9 of 40, not 9 of 100."""
    summary = Summary(load_spec(small_sweep(tmp_path)).spec)
    of_rest = {"placed": 100, "played": 40, "collided": 9, "failed": 60, "scores": (0.5,) * 38}
    summary.add(replace(COUNT, cases=100, **of_rest))
    (entry,) = summary.table()
    monkeypatch.setenv("COLUMNS", "160")

    assert {name: entry[name] for name in ("placed", "played", "collided", "scored")} == {
        "placed": 100, "played": 40, "collided": 9, "scored": 38,
    }  # fmt: skip
    cells = [
        [cell.strip() for cell in line.split("│")[1:-1]]
        for line in printed(capsys, [entry]).splitlines()
    ]
    assert ["scp", "x", "100", "40", "9", "60", "", "0.500 of 38"] in cells


def test_parts_from_before_played_cases_were_counted_say_what_they_can(tmp_path: Path) -> None:
    summary = Summary(load_spec(small_sweep(tmp_path)).spec)
    summary.add(replace(COUNT, cases=10, placed=6, failed=3, not_placed={"too short": 2}))

    assert summary.totals()["played"] == 5
    older = {"cases": 10, "placed": 6, "failed": 0, "not_placed": {"the most frequent three": 2}}
    assert played_of(older) == 6


def printed(
    capsys: pytest.CaptureFixture[str],
    scenarios: list[dict[str, Any]],
    unplaced: Sequence[NotPlaced | dict[str, Any]] = (),
) -> str:
    counts = {"rows": 24, "placed": 12, "worlds": 3, "jobs": 4, "jobs_played": 4}
    told = {"playing_s": 0.552, "unplaced": unplaced, "placed_nowhere": [], "failures": {}}
    more = {"scenarios": scenarios, "rows_sha256": "0", "attribution": ""}
    print_summary(Path("out"), counts | told | more)
    return capsys.readouterr().out


def test_places_that_were_not_found_are_counted_and_told_with_the_reason(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """As they are found, and as the shards of a sweep have them."""
    short = NotPlaced(scenario_id="rtip", junction_id="n1", reason="too short", applies=True)
    found = (short, msgspec.to_builtins(replace(short, junction_id="n2")))
    others = [replace(short, reason=why) for why in ("built over", "c", "d", "e")]
    said = printed(capsys, [], [*found, *others])

    assert "24 rows of 3 Worlds, 4 of 4 jobs played now in 0.6 s\n" in printed(capsys, [])
    assert "in 0.6 s; places not found: 6\n" in said
    assert [line for line in said.splitlines() if line.startswith("no place")] == [
        "no place: 2 junctions for rtip: too short",
        "no place: 1 junction for rtip: built over",
        "no place: 1 junction for rtip: c",
        "no place: 2 junctions for rtip: other reasons",
    ]


def test_rows_that_were_not_placed_are_counted_alike_in_all_and_by_the_reason(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A row whose stack hung was placed all the same."""
    summary = Summary(load_spec(small_sweep(tmp_path)).spec)
    count = replace(COUNT, placed=2, not_placed={"too short": 3, "a": 1, "b": 2, "c": 1})
    for planner in ("x", "y"):
        summary.add(replace(count, planner=planner))
    summary.add(replace(COUNT, scenario="cpta", planner="y", not_placed={"too short": 1}))
    said = printed(capsys, summary.table())

    assert "24 rows of 3 Worlds, 15 of them not placed, 4 of 4 jobs" in said
    assert [line for line in said.splitlines() if line.startswith("not placed")] == [
        "not placed: 1 row of cpta: too short",
        "not placed: 6 rows of scp: too short",
        "not placed: 4 rows of scp: b",
        "not placed: 2 rows of scp: a",
        "not placed: 2 rows of scp: other reasons",
    ]
