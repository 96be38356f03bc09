"""A report of a run as a file: what it says, that it stands alone, and that its commands run."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

from foretwin.contracts.errors import UserError
from foretwin.orchestrator.commands.repeat import repeat
from foretwin.orchestrator.report.blocks import UNKNOWN
from foretwin.orchestrator.report.driven_track import CarTrack
from foretwin.orchestrator.report.page import html_of
from foretwin.orchestrator.report.plots import drive_plot
from foretwin.orchestrator.report.write_report import report_of_folders, write_report
from tests.orchestrator.report.read_page import MOST_BYTES, ReadPage
from tests.orchestrator.report.told_runs import (
    NAME,
    OSM,
    run_of_nothing,
    run_without_junctions,
    told_run,
)

COVERS = (
    "foretwin.orchestrator.report.driven_track",
    "foretwin.orchestrator.report.first_page",
    "foretwin.orchestrator.report.junction_parts",
    "foretwin.orchestrator.report.junction_picture",
    "foretwin.orchestrator.report.plots",
    "foretwin.orchestrator.report.replayed",
    "foretwin.orchestrator.report.run_report",
    "foretwin.orchestrator.report.vehicle_parts",
)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return told_run(tmp_path_factory.mktemp("runs"))


@pytest.fixture(scope="module")
def page(run: Path) -> str:
    out = run.parent / "report.html"
    write_report([run], out)
    return out.read_text(encoding="utf-8")


def test_it_stands_alone(page: str) -> None:
    read = ReadPage(page)

    assert read.loaded == []
    assert read.nameless == 0
    assert read.links
    assert [link for link in read.links if not link.startswith("#")] == []
    assert {link.removeprefix("#") for link in read.links} - read.anchors == set()
    assert not re.search(r"url\(\s*['\"]?(https?:)?//", page)
    assert len(page.encode()) < MOST_BYTES


def test_it_says_what_was_foreseen_and_what_came(page: str) -> None:
    assert "state to result, 95 % within" in page
    assert f"1 · {NAME}" in page
    assert "The car was there at 15.0 s with 29 km/h" in page
    assert "9 futures of that round, played again to the recorded hash" in page
    assert (
        "foreseen is to be watched: Pedestrian from behind a parked van at "
        f"{NAME}. Simulation and reality agree in 3 of 4 judged windows."
    ) in page
    assert "too optimistic" in page
    assert "1 of 2 that could begin" in page
    assert OSM in page


def test_a_drive_in_lock_step_has_no_rounds_in_time_since_it_waits_for_them(tmp_path: Path) -> None:
    folder = told_run(tmp_path)
    record = json.loads((folder / "run.json").read_text())
    record["config"]["speed"] = None
    (folder / "run.json").write_text(json.dumps(record))

    report = report_of_folders([folder])

    page = html_of(report)
    assert "state to result, 95" not in page
    assert "state to result, ms" not in page
    assert "in lock step: the drive waited for each round" in page
    assert "In lock step the drive waits for Worlds, so that none is late" in page
    assert report.figures[-1].value == UNKNOWN
    assert report.figures[-1].note == "in lock step the drive waits for its rounds"
    assert "in time" not in report.verdict


def test_pictures_and_commands_in_sentences_are_explained(page: str) -> None:
    assert "; yellow where they touch; black what the car did" in page
    assert "foretwin report … --against LOG" in ReadPage(page).codes
    assert "<p>`" not in page


def test_a_small_parameter_is_not_shown_as_nothing(tmp_path: Path) -> None:
    one = {
        "name": "understeer_gradient_rad_per_mps2", "in_use": -0.000234, "identified": None,
        "low": None, "high": None, "departs": False, "reason": "too slow",
    }  # fmt: skip
    tuning = {"verdicts": [], "parameters": [one], "changes": []}

    page = html_of(report_of_folders([told_run(tmp_path, tuning=tuning)]))

    assert '<td class="n " data-order="-0.000234">-0.000234</td>' in page


def test_worst_futures_come_with_a_command_that_plays_them_again(run: Path, page: str) -> None:
    commands = [code.split() for code in ReadPage(page).codes if code.startswith("foretwin repeat")]

    assert len(commands) >= 4
    assert {command[2] for command in commands} == {str(run)}
    for command in commands[::3]:
        assert repeat(run, command[3], view=False).code == 0


def test_futures_of_another_hash_are_not_drawn(run: Path, page: str, tmp_path: Path) -> None:
    import shutil

    import pyarrow as pa
    import pyarrow.parquet as pq

    copied = tmp_path / "run"
    shutil.copytree(run, copied)
    file = copied / "results" / "futures.parquet"
    table = pq.read_table(file)
    column = table.column_names.index("trajectory_sha256")
    others = pa.array(["0" * 64, *table["trajectory_sha256"].to_pylist()[1:]])
    pq.write_table(table.set_column(column, "trajectory_sha256", others), file)

    changed = html_of(report_of_folders([copied]))

    assert "8 futures of that round" in changed
    assert "1 of them come to another hash here and are not drawn" in changed


def test_a_run_without_junctions_says_so(tmp_path: Path) -> None:
    page = html_of(report_of_folders([run_without_junctions(tmp_path)]))

    assert "The car met no junction in this drive: nothing was foreseen." in page
    assert "the way driven" in page


def test_a_run_of_nothing_is_told_honestly(tmp_path: Path) -> None:
    page = html_of(report_of_folders([run_of_nothing(tmp_path)]))

    assert "The car met no junction" in page
    assert "ended: failed" in page
    assert "record holds no ledger." in page
    assert "No seconds were both simulated and driven." in page


def test_what_is_missing_of_a_recovered_run_makes_the_verdict(tmp_path: Path) -> None:
    lost = {"lost": ["the last 0.5 s of rounds"], "unknown": ["missed rounds"]}
    run = told_run(tmp_path, exit="recovered", recovered=lost, ledger={"rounds": None})
    (run / "drive.mcap").unlink()

    report = report_of_folders([run])

    assert report.tone == "bad"
    assert report.verdict.endswith("Something is missing: the last 0.5 s of rounds.")
    page = html_of(report)
    assert "Not known of this recovered run: missed rounds" in page
    assert "what the car did is not recorded" in page


@pytest.mark.parametrize("how", ["damaged", "missing"])
def test_where_the_futures_cannot_be_read_nothing_is_said_of_what_was_foreseen(
    tmp_path: Path, how: str
) -> None:
    run = told_run(tmp_path, futures={"count": 9})
    assert "he gravest of what was foreseen" in report_of_folders([run]).verdict
    table = run / "results" / "futures.parquet"
    if how == "damaged":
        table.write_bytes(table.read_bytes()[:200])
    else:
        table.unlink()

    report = report_of_folders([run])

    assert (report.tone, report.unread) == ("bad", (f"the table of futures is {how}",))
    assert "foreseen" not in report.verdict
    assert report.verdict.endswith(f"The table of futures is {how}.")
    (gravest,) = [one for one in report.figures if one.name == "gravest foreseen"]
    assert gravest.value == UNKNOWN
    assert report.figures[0].note == "1 round"


def test_a_drive_whose_recording_is_empty_is_not_told_as_whole(tmp_path: Path) -> None:
    recorded = {"rounds": None, "telemetry": {"published": 9, "recorded": 9, "lost": 0}}
    run = told_run(tmp_path, ledger=recorded)
    assert report_of_folders([run]).unread == ()
    (run / "drive.mcap").write_bytes(b"")

    report = report_of_folders([run])

    assert report.unread == ("the recording of the car, drive.mcap, cannot be read",)
    assert report.tone == "bad"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('{"intersections": "no"}', "run.json: intersections: a list is asked for"),
        ('{"futures": [1]}', "run.json: futures: a table is asked for"),
    ],
)
def test_a_record_that_no_drive_wrote_is_refused(tmp_path: Path, text: str, said: str) -> None:
    (tmp_path / "run.json").write_text(text)
    with pytest.raises(UserError, match=re.escape(said)):
        report_of_folders([tmp_path])


def test_a_torn_record_is_said_to_be_none(tmp_path: Path) -> None:
    run = told_run(tmp_path)
    (run / "run.json").write_text('{"run_id": "x", "inter')
    assert report_of_folders([run]).unread == ("its run.json holds no record of a drive",)


def test_a_run_that_goes_on_or_was_killed_is_refused(tmp_path: Path) -> None:
    killed = told_run(tmp_path, exit="running")

    with pytest.raises(UserError, match="foretwin recover"):
        report_of_folders([killed])


def test_a_folder_that_is_no_run_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"no run\.json and no sweep\.json"):
        report_of_folders([tmp_path])


def test_names_of_strangers_are_shown_and_do_nothing(tmp_path: Path) -> None:
    hostile = "<script>alert(1)</script>\x1b[31m"
    run = told_run(tmp_path, troubles=[hostile])

    page = html_of(report_of_folders([run]))

    assert "<script>alert(1)" not in page
    assert "&lt;script&gt;alert(1)" in page
    assert "\x1b" not in page


def test_numbers_of_junctions_that_follow_closely_stand_above_each_other() -> None:
    time_s = np.linspace(0.0, 100.0, 11)
    stamps = np.arange(11, dtype=np.int64)
    track = CarTrack(
        stamp_ns=stamps, time_s=time_s, lat_lon_deg=np.zeros((11, 2)), speed_mps=np.full(11, 10.0)
    )

    drawn = drive_plot(track, [(2, 51.0), (1, 50.0), (3, 80.0), (4, 52.0)])

    texts = [one for one in drawn.renderers if one.glyph.__class__.__name__ == "Text"]
    heights = {one.data_source.data["text"][0]: one.data_source.data["y"][0] for one in texts}
    assert heights[" 1"] == heights[" 3"] == 0.0
    assert heights[" 2"] > 3.0
    assert heights[" 4"] == 2.0 * heights[" 2"]
