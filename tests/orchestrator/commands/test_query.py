from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest

from foretwin.orchestrator.commands.cli import run as command
from tests.orchestrator.lake.made_runs import made_run

COVERS = ("foretwin.orchestrator.commands.cli_across",)


def test_an_answer_is_a_table_json_or_csv(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = made_run(tmp_path / "runs", 3, futures=2)
    sql = "SELECT run, index, values, end_x_m, NULL AS nothing FROM futures ORDER BY index"

    assert command(["query", sql, str(tmp_path / "runs")]) == 0
    assert "3.125" in capsys.readouterr().out
    assert command(["query", sql, str(tmp_path / "runs"), "--json"]) == 0
    first, second = json.loads(capsys.readouterr().out)
    assert first == {
        "run": run.name, "index": 0, "values": {"gap_s": 0.0}, "end_x_m": 3.0, "nothing": None,
    }  # fmt: skip
    assert second["end_x_m"] == 3.125
    assert command(["query", sql, str(tmp_path / "runs"), "--csv"]) == 0
    header, *rows = csv.reader(capsys.readouterr().out.splitlines())
    assert header == ["run", "index", "values", "end_x_m", "nothing"]
    assert rows[1] == [run.name, "1", '{"gap_s":1.0}', "3.125", ""]


def test_columns_of_one_name_are_all_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = made_run(tmp_path, futures=1)
    sql = "SELECT index, 7 AS index, 8 AS index, 9 AS index_1 FROM futures"

    assert command(["query", sql, str(run), "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == [
        {"index": 0, "index_2": 7, "index_3": 8, "index_1": 9}
    ]
    assert command(["query", sql, str(run), "--csv"]) == 0
    assert capsys.readouterr().out == "index,index_2,index_3,index_1\n0,7,8,9\n"


def test_blobs_intervals_and_infinities_are_as_documented(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = made_run(tmp_path, futures=1)
    sql = r"SELECT '\xFF'::BLOB AS job, INTERVAL 90 MINUTE AS lasted, 1.0 / 0 AS share FROM runs"

    assert command(["query", sql, str(run), "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == [{"job": "/w==", "lasted": 5400, "share": None}]
    assert command(["query", sql, str(run), "--csv"]) == 0
    assert capsys.readouterr().out == "job,lasted,share\n/w==,5400.0,inf\n"
    assert command(["query", sql, str(run)]) == 0
    assert "1 bytes" in capsys.readouterr().out


def test_what_does_not_fit_a_terminal_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = made_run(tmp_path, futures=250)

    assert command(["query", "FROM futures", str(run)]) == 0

    said = capsys.readouterr()
    assert "200 of 250 rows; --csv and --json give all" in said.err
    assert "columns fit here" in said.err
    assert said.out.count("\n") < 250


def test_without_sql_the_views_and_their_columns_are_listed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    made_run(tmp_path / "runs")
    monkeypatch.chdir(tmp_path)

    assert command(["query", "--json"]) == 0

    told = json.loads(capsys.readouterr().out)
    assert {"view": "futures", "column": "collided", "type": "BOOLEAN"} in told
    assert {"view": "runs", "column": "verdict", "type": "VARCHAR"} in told


def test_where_no_run_is_the_views_are_listed_all_the_same(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)

    assert command(["query", "--json"]) == 0

    said = capsys.readouterr()
    assert said.err == "foretwin: no runs are here; these are the views of any run\n"
    told = json.loads(said.out)
    assert {"view": "futures", "column": "collided", "type": "BOOLEAN"} in told
    assert {"view": "runs", "column": "verdict", "type": "VARCHAR"} in told
    assert command(["query", "FROM futures"]) == 2
    assert "neither runs nor sweeps is here" in capsys.readouterr().err


def test_a_wrong_question_is_one_line_and_exit_code_2(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = made_run(tmp_path)

    assert command(["query", "SELECT colided FROM futures", str(run)]) == 2
    said = capsys.readouterr().err
    assert said.startswith("foretwin: query: no column 'colided' (did you mean collided")
    assert said.count("\n") == 1
    assert command(["query", "SELECT 1", str(tmp_path / "nowhere")]) == 2
