from __future__ import annotations

import json
from pathlib import Path

import pytest

from foretwin.orchestrator.commands.cli import run as command
from tests.orchestrator.lake.made_runs import made_run, made_sweep


def test_a_folder_of_runs_is_collected_and_said_in_a_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for number in range(2):
        made_run(tmp_path / "runs", number)
    sweep = made_sweep(tmp_path / "sweep")
    asked = ["collect", str(tmp_path / "runs"), str(sweep), "--into", str(tmp_path / "lake")]

    assert command(asked) == 0
    assert capsys.readouterr().out == f"{tmp_path}/lake: 3 collected; 25 rows added\n"
    assert command([*asked, "--verify"]) == 0
    files = len(list((tmp_path / "lake").rglob("*.parquet")))
    holds = f"{files} of {files} files hold, 0 are damaged"
    assert capsys.readouterr().out == f"{tmp_path}/lake: 3 were there; 0 rows added; {holds}\n"
    assert command(["collect", "--into", str(tmp_path / "lake"), "--verify"]) == 0
    assert capsys.readouterr().out == f"{tmp_path}/lake: {holds}\n"


def test_what_is_refused_is_said_and_the_others_are_collected(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    made_run(tmp_path / "runs", 1)
    unfinished = made_run(tmp_path / "runs", 2, exit="running")

    assert command(["collect", str(tmp_path / "runs"), "--into", str(tmp_path / "lake")]) == 3

    said = capsys.readouterr()
    assert said.out == f"{tmp_path}/lake: 1 collected, 1 refused; 7 rows added\n"
    assert f"refused: {unfinished}: the drive never came to its end: `foretwin recover" in said.err
    assert command(["collect", str(unfinished), "--into", str(tmp_path / "lake")]) == 2


def test_a_damaged_file_of_the_lake_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lake = tmp_path / "lake"
    command(["collect", str(made_run(tmp_path)), "--into", str(lake)])
    file = next(iter(lake.rglob("*.parquet")))
    file.write_bytes(b"?")
    capsys.readouterr()

    assert command(["collect", "--into", str(lake), "--verify", "--json"]) == 3

    said = capsys.readouterr()
    told = json.loads(said.out)
    assert told["damaged"] == [f"{file}: is not what was written"]
    assert told["files_checked"] == len(list(lake.rglob("*.parquet")))
    assert "damaged: " in said.err


@pytest.mark.parametrize(
    ("asked", "told"),
    [
        ([], "name folders of runs or sweeps"),
        (["nowhere"], "nowhere: no such folder"),
        (["--into", "ftp://a/b", "."], "neither a run nor a sweep"),
        (["--into", "nowhere", "--verify"], "--into nowhere: no lake is there"),
    ],
)
def test_what_cannot_be_collected_is_one_line(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    asked: list[str],
    told: str,
) -> None:
    monkeypatch.chdir(tmp_path)

    assert command(["collect", *asked]) == 2

    said = capsys.readouterr().err
    assert told in said
    assert said.count("\n") == 1
