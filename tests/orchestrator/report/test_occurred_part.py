"""What occurred, as a section: times, places, and what is beyond a threshold."""

from __future__ import annotations

from pathlib import Path

import pytest

from foretwin.orchestrator.occurred.occurred import Occurred
from foretwin.orchestrator.report.blocks import Listed, Prose
from foretwin.orchestrator.report.material import RunMaterial
from foretwin.orchestrator.report.occurred_part import occurred_part, told_of
from foretwin.orchestrator.report.passages import passages
from foretwin.sim_worker.analysis.occurred.rows import OccurredScenario
from tests.orchestrator.report.told_runs import (
    START_NS,
    run_of_nothing,
    run_without_junctions,
    told_run,
)


def test_scenarios_stand_by_time_with_their_junction(tmp_path: Path) -> None:
    passed = passages(RunMaterial(told_run(tmp_path)))
    one = OccurredScenario(
        kind="cut_in",
        begin_ns=START_NS + 2_000_000_000,
        end_ns=START_NS + 5_000_000_000,
        junction_id=str(passed[0].place["id"]),
        other_id="7",
        other_kind="car",
        ttc_s=1.2,
        beyond=("ttc_s",),
    )

    chapter = told_of(Occurred(scenarios=(one,), sees_others=True), START_NS, passed)

    said, table = chapter.blocks
    assert isinstance(said, Prose)
    assert said.text.startswith("1 scenario recognised")
    assert said.text.endswith("; 1 of them beyond a threshold (1 conflict).")
    assert isinstance(table, Listed)
    (cells,) = table.rows
    assert [cell.text for cell in cells[:4]] == ["2.0\u00a0s", "5.0\u00a0s", "cut in", "car 7"]
    assert cells[4].to == passed[0].anchor
    assert cells[8].tone == "watch"


def test_of_a_junction_passed_twice_each_passage_has_what_occurred_in_it(tmp_path: Path) -> None:
    run = RunMaterial(told_run(tmp_path))
    place = run.record["intersections"][0]
    run.record["intersections"] = [place, place | {"arrived_at_s": 60.0}]
    occurred = [
        OccurredScenario(
            kind="through_straight",
            begin_ns=START_NS + second * 10**9,
            end_ns=START_NS + (second + 3) * 10**9,
            junction_id=str(place["id"]),
        )
        for second in (14, 58)
    ]

    told = Occurred(scenarios=tuple(occurred), sees_others=True)
    table = told_of(told, START_NS, passages(run)).blocks[1]

    assert isinstance(table, Listed)
    assert [cells[4].to for cells in table.rows] == ["junction-1", "junction-2"]


@pytest.mark.parametrize(
    ("kind", "side", "said"),
    [
        ("turn_right", "right", "turn right"),
        ("crossing_from_left", "left", "crossing from left"),
        ("cut_in", "left", "cut in, left"),
        ("stop", "", "stop"),
    ],
)
def test_a_side_is_said_once(kind: str, side: str, said: str) -> None:
    one = OccurredScenario(kind=kind, side=side, begin_ns=START_NS, end_ns=START_NS + 1)
    table = told_of(Occurred(scenarios=(one,), sees_others=True), START_NS, []).blocks[1]
    assert isinstance(table, Listed)
    assert table.rows[0][2].text == said


def test_a_run_without_a_recording_says_why_nothing_is_told(tmp_path: Path) -> None:
    chapter = occurred_part(RunMaterial(run_of_nothing(tmp_path)), [])

    (said,) = chapter.blocks
    assert isinstance(said, Prose)
    assert said.text.startswith("What occurred cannot be told")


def test_virtual_traffic_is_named_as_nobody_that_was_met(tmp_path: Path) -> None:
    run = RunMaterial(run_without_junctions(tmp_path))
    assert "irtual" not in str(occurred_part(run, []).blocks)
    run.record["virtual_traffic"] = {"most_users": 20}
    said = occurred_part(run, []).blocks[-1]
    assert isinstance(said, Prose)
    assert said.text == "Virtual traffic, 20 road users at most, counts for nothing here."
