"""Several runs side by side: what changed from the first to the last."""

from __future__ import annotations

from pathlib import Path

import pytest

from foretwin.contracts.errors import UserError
from foretwin.orchestrator.report.page import html_of
from foretwin.orchestrator.report.write_report import report_of_folders
from tests.orchestrator.report.read_page import ReadPage
from tests.orchestrator.report.told_runs import run_without_junctions, told_run


def test_two_runs_stand_side_by_side(tmp_path: Path) -> None:
    one = told_run(tmp_path / "one")
    far = {"ade_m": {"2": 0.3, "4": 1.3}, "count": {"2": 1, "4": 1}}
    other = told_run(tmp_path / "other", comparison=far, config={"planner": "constant_speed"})

    report = report_of_folders([one, other])
    page = html_of(report)

    assert report.verdict.startswith("What B foresaw lies 0.50 m farther from what was driven")
    assert "constant_speed" in page
    assert "last minus first" in page
    read = ReadPage(page)
    assert read.nameless == 0
    assert {link.removeprefix("#") for link in read.links} - read.anchors == set()


def test_who_met_a_junction_that_the_other_did_not_is_named(tmp_path: Path) -> None:
    one, none = told_run(tmp_path / "one"), run_without_junctions(tmp_path / "other")

    assert "; A met 1 junction that B did not. " in report_of_folders([one, none]).verdict
    assert "; B met 1 junction that A did not. " in report_of_folders([none, one]).verdict


def test_the_same_run_twice_changes_nothing(tmp_path: Path) -> None:
    one = told_run(tmp_path)

    page = html_of(report_of_folders([one, one]))

    assert "Settings, versions and map are the same." in page
    assert page.count("same</td>") > 3


def test_what_cannot_be_read_of_one_of_them_stands_first(tmp_path: Path) -> None:
    one, other = told_run(tmp_path / "one"), told_run(tmp_path / "other", futures={"count": 9})
    (other / "results" / "futures.parquet").unlink()

    report = report_of_folders([one, other])

    assert report.unread == ("B: the table of futures is missing",)
    assert "B: the table of futures is missing." in html_of(report)


def test_runs_and_sweeps_do_not_go_together(tmp_path: Path) -> None:
    one = told_run(tmp_path)
    (tmp_path / "sweep").mkdir()
    (tmp_path / "sweep" / "sweep.json").write_text("{}")

    with pytest.raises(UserError, match="of one sweep, or of runs"):
        report_of_folders([one, tmp_path / "sweep"])


def test_how_soon_results_came_is_compared_of_drives_with_a_clock_alone(tmp_path: Path) -> None:
    live = told_run(tmp_path / "live", state_to_result_ms_p95=123.0)
    stepped = told_run(tmp_path / "step", state_to_result_ms_p95=9100.0, config={"speed": None})

    page = html_of(report_of_folders([live, stepped]))

    assert 'data-order="123"' in page
    assert 'data-order="9100"' not in page
