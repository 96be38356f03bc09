"""`foretwin gap`: a table, plots, a verdict; and one line for what is no drive."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from orchestrator.cli import run
from telemetry.mcap_file import create
from tests.sim_worker.faulty_standin import drive_of
from tests.sim_worker.gap.test_verdict import END_S, SEED


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A drive whose steering sensor sends degrees."""
    drive = drive_of(SEED, "steering_read_in_degrees", end_s=END_S)
    file = tmp_path_factory.mktemp("gap") / "drive.mcap"
    with create(file, info=drive.info) as writer:
        for channel, message in drive.samples:
            writer.add(channel, message)
    return file


def test_the_verdict_names_degrees_in_json(
    recording: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["gap", str(recording), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["independent"] is True
    assert {row["horizon_s"] for row in said["rows"]} == {1.0, 2.0, 4.0, 8.0}
    assert all(row["rms"]["along_m"] >= 0.0 for row in said["rows"])
    first = said["verdicts"][0]
    assert (first["culprit"], first["cause"]) == ("vehicle", "steering_in_degrees")
    assert first["evidence"][0]["expected"] == 1.0


def test_the_table_and_the_plots(
    recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["gap", str(recording), "--vehicle", "bmw_320i", "--out", str(tmp_path / "p")]) == 0
    said = capsys.readouterr().out
    assert "real vehicle, steering_in_degrees" in said
    assert "manoeuvre" in said
    for name in ("gap_over_time.png", "gap_by_horizon.png"):
        assert (tmp_path / "p" / name).read_bytes().startswith(b"\x89PNG")


def test_what_is_no_drive_is_said_in_one_line(
    recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["gap", str(tmp_path / "none.mcap")]) == 2
    assert run(["gap", str(recording), "--vehicle", "spaceship"]) == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 2
    assert "none.mcap" in lines[0]
    assert "spaceship" in lines[1]
