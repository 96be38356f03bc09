from __future__ import annotations

import csv
import json
import os
from pathlib import Path

import pytest

from foretwin.orchestrator.commands.cli import run as command
from foretwin.orchestrator.lake.collect import collect
from foretwin.orchestrator.lake.store import FolderStore
from foretwin.world_gen.world_store import WorldStore
from tests.orchestrator.lake.made_runs import MAP_SHA256, made_run, made_sweep
from tests.sim_worker.scenarios.worlds import cross


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A whole run, one that was killed, one with a damaged table, one with a torn record, a sweep,
    and what is none of these."""
    runs = tmp_path / "runs"
    made_run(runs, 1, drive_time_s=75.0)
    made_run(runs, 2, exit="running")
    damaged = made_run(runs, 3)
    (damaged / "results" / "gaps.parquet").write_bytes(b"PAR1")
    (made_run(runs, 4) / "run.json").write_text("{")
    made_sweep(runs / "sweep", rows=6, collided=1, placed=6, failed=0)
    (runs / "empty").mkdir()
    (runs / "notes.txt").touch()
    return runs


def test_every_run_has_its_row_and_what_is_wrong_stands_there(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert command(["runs", str(folder), "--json"]) == 0

    rows = json.loads(capsys.readouterr().out)
    states = {Path(row["folder"]).name[-7:]: row["state"] for row in rows}
    assert states == {
        "01-abcd": "completed", "02-abcd": "killed", "03-abcd": "damaged", "04-abcd": "damaged",
        "sweep": "completed",
    }  # fmt: skip
    remarks = [row["remark"] for row in rows if row["state"] == "damaged"]
    assert "gaps.parquet: is cut short" in remarks[0]
    assert "run.json" in remarks[1]
    assert "record" not in rows[0]


def test_a_terminal_shows_when_what_how_long_and_what_was_found(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "200")

    assert command(["runs", str(folder)]) == 0

    said = capsys.readouterr()
    assert "1:15 min" in said.out
    assert "1 of 6 collided, 0 failed" in said.out
    assert said.err.count("\n") == 3
    assert "20261123-000002-abcd: foretwin recover " in said.err


def test_what_a_narrow_terminal_shows_of_a_run_is_not_cut(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "72")

    assert command(["runs", str(folder)]) == 0

    assert "…" not in capsys.readouterr().out


def test_a_list_is_csv_too(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert command(["runs", str(folder), "--csv"]) == 0

    header, *rows = csv.reader(capsys.readouterr().out.splitlines())
    assert header[:4] == ["run", "kind", "time", "state"]
    assert len(rows) == 5


def test_the_runs_of_a_lake_are_listed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run = made_run(tmp_path / "runs")
    collect(FolderStore(tmp_path / "lake"), [run])

    assert command(["runs", str(tmp_path / "lake"), "--json"]) == 0

    (row,) = json.loads(capsys.readouterr().out)
    assert (row["run"], row["state"], row["folder"]) == (run.name, "completed", str(run))


def test_runs_of_a_lake_stand_in_the_order_of_time_and_sweeps_have_a_day_and_a_map(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    late, early = made_run(tmp_path, day="20261124"), made_run(tmp_path, day="20261122")
    between = made_run(tmp_path, vehicle_id="bus")
    sweep = made_sweep(tmp_path / "sweep", spec={"map": "town.osm"})
    WorldStore(sweep / "worlds").save(cross())
    os.utime(sweep / "sweep.json", (0, 0))
    collect(FolderStore(tmp_path / "lake"), [late, early, sweep])

    assert command(["runs", str(tmp_path / "lake"), str(between), "--json"]) == 0

    rows = json.loads(capsys.readouterr().out)
    names = ["sweep-0cdb5ed7a3db79d9", early.name, between.name, late.name]
    assert [row["run"] for row in rows] == names
    assert rows[0]["time"][:5] in ("1969-", "1970-")
    assert {row["map_sha256"] for row in rows[1:]} == {MAP_SHA256}
    assert rows[0]["map_sha256"] == cross().map_sha256


def test_a_run_that_is_named_twice_or_lies_in_a_lake_too_is_listed_once(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = made_run(tmp_path / "runs")
    collect(FolderStore(tmp_path / "lake"), [run])
    places = [str(run.parent), str(run), str(tmp_path / "lake"), str(tmp_path / "lake")]

    assert command(["runs", *places, "--json"]) == 0

    assert [row["run"] for row in json.loads(capsys.readouterr().out)] == [run.name]


def test_a_place_without_runs_is_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert command(["runs", str(tmp_path)]) == 2
    assert "neither a run nor a sweep" in capsys.readouterr().err
