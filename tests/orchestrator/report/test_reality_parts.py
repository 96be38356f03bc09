"""How far simulation and drive part, as a report tells it."""

from __future__ import annotations

from pathlib import Path

import pytest

from foretwin.orchestrator.report.blocks import Listed
from foretwin.orchestrator.report.material import RunMaterial
from foretwin.orchestrator.report.reality_parts import agreement_part, gap_part
from tests.orchestrator.report.told_runs import run_of_nothing, told_run

OUTCOMES = {
    "agree_pass": 3, "agree_fail": 0, "too_pessimistic": 0, "too_optimistic": 0,
    "not_observable": 2,
}  # fmt: skip


@pytest.mark.parametrize(
    ("more", "shown", "said"),
    [
        ({"not_asked": 4}, "4", "Not asked: the recording has not what it takes to ask"),
        ({}, "–", "the run's record does not tell these apart"),  # noqa: RUF001
    ],
)
def test_asked_in_vain_and_not_asked_are_told_apart_where_the_run_does(
    more: dict[str, int], shown: str, said: str, tmp_path: Path
) -> None:
    run = RunMaterial(run_of_nothing(tmp_path / "run"))
    run.record["agreement"] = {
        "windows": 9, "overall": OUTCOMES, "by_criterion": {"comfort": OUTCOMES | more},
        "flips": {},
    }  # fmt: skip

    table = agreement_part(run).blocks[0]

    assert isinstance(table, Listed)
    assert table.columns[-2:] == ("not observable", "not asked")
    assert [cell.text for cell in table.rows[1][-2:]] == ["2", shown]
    assert said in table.note


def test_beside_the_gap_stands_how_often_it_was_measured(tmp_path: Path) -> None:
    table = gap_part(RunMaterial(told_run(tmp_path)), []).blocks[0]

    assert isinstance(table, Listed)
    assert table.note.startswith(
        "Runs of up to 2 s were measured once a second, longer ones once in 4 s. "
    )
