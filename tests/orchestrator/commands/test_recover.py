"""`foretwin recover`: a line for each part, 0 where all is read, 3 where something is lost."""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path

import pytest

from foretwin.orchestrator.commands.cli import run as command
from foretwin.orchestrator.record.results import TABLES
from foretwin.orchestrator.record.run_state import run_lock
from tests.orchestrator.record.ended_badly import killed_run


def test_each_part_has_its_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run = killed_run(tmp_path / "run")
    assert command(["recover", str(run)]) == 0
    lines = capsys.readouterr().out.splitlines()

    assert {line.split(":")[0] for line in lines[:-1]} == {*TABLES, "drive.mcap", "unknown"}
    assert lines[-1] == f"{run}: recovered; all that was written can be read"
    assert command(["recover", str(run)]) == 0
    assert capsys.readouterr().out == f"{run}: whole (exit: recovered); nothing to recover\n"


def test_what_is_lost_is_said_and_is_exit_code_3(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = killed_run(tmp_path / "run")
    stream = run / "results" / "rounds.arrows"
    os.truncate(stream, stream.stat().st_size - 3)
    assert command(["recover", str(run)]) == 3
    told = capsys.readouterr().out

    assert "\nrounds: 2 rows; a torn end of " in told
    assert told.endswith(f"{run}: recovered; lost in part: 1 of {len(TABLES) + 1}\n")


def test_what_is_gone_or_cut_off_is_lost(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = killed_run(tmp_path / "run")
    assert command(["recover", str(run)]) == 0
    record = json.loads((run / "run.json").read_text())
    record["ledger"] = {"telemetry": {"published": 5, "recorded": 5, "lost": 0}}
    (run / "run.json").write_text(json.dumps(record))
    assert command(["recover", str(run)]) == 0
    (run / "drive.mcap").unlink()
    rounds = run / "results" / "rounds.parquet"
    os.truncate(rounds, rounds.stat().st_size - 8)
    capsys.readouterr()
    assert command(["recover", str(run)]) == 3
    told = capsys.readouterr().out

    assert "rounds: lost: rounds.parquet is cut off or damaged\n" in told
    assert "drive.mcap: lost: it is gone\n" in told
    shutil.rmtree(run / "results")
    assert command(["recover", str(run)]) == 2
    assert capsys.readouterr().err == f"foretwin: {run}: its results/ is gone\n"


def test_what_cannot_be_recovered_is_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = killed_run(tmp_path / "run")
    with run_lock(run):
        assert command(["recover", str(run)]) == 2
    assert command(["recover", str(tmp_path)]) == 2
    assert command(["recover", str(tmp_path / "nowhere")]) == 2

    assert capsys.readouterr().err.splitlines() == [
        f"foretwin: {run}: the drive still runs",
        f"foretwin: {tmp_path}: no folder of a run",
        f"foretwin: {tmp_path / 'nowhere'}: no folder of a run",
    ]
