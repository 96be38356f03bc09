"""`foretwin identify`: a table, an object, plots and a vehicle file."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from orchestrator.cli import run
from sim_worker.vehicle.parameters import load_vehicle
from telemetry.mcap_file import create
from tests.telemetry.standin_drive import whole_drive


@pytest.fixture(scope="module")
def log_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A short drive of the stand-in car with two bends, recorded."""
    file = tmp_path_factory.mktemp("log") / "drive.mcap"
    drive = whole_drive()
    with create(file, info=drive.source.info) as writer:
        for channel, message in drive.samples:
            if channel != "plan":
                writer.add(channel, message)
    return file


def test_json_holds_each_parameter_with_its_interval_and_reason(
    log_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "found"
    assert run(["identify", str(log_file), "--json", "--out", str(out)]) == 0
    told = json.loads(capsys.readouterr().out)
    ratio = told["steering_ratio"]
    assert ratio["value"] == pytest.approx(15.3, rel=0.05)
    assert ratio["low"] < ratio["value"] < ratio["high"]
    assert told["wheelbase_m"]["value"] is None
    assert "no tyre angle" in told["wheelbase_m"]["reason"]
    assert told["steering_delay_s"]["value"] == pytest.approx(0.1, abs=0.01)
    for name in ("estimates.png", "steering.png"):
        assert (out / name).read_bytes().startswith(b"\x89PNG")
    tuned = load_vehicle(out / "vehicle.toml")
    for name in ("steering_ratio", "steering_delay_s"):
        found = told[name]
        expected = found["value"] if found["taken"] else found["prior"]
        assert getattr(tuned, name).value == pytest.approx(expected)
    assert tuned.steering_delay_s.source.startswith("identified from drive.mcap")


def test_a_table_is_printed_by_default(
    log_file: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    assert run(["identify", str(log_file)]) == 0
    printed = capsys.readouterr().out
    assert "steering_ratio" in printed
    assert "no tyre angle was measured" in printed


def test_what_is_no_log_is_said_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["identify", str(tmp_path / "none.mcap")]) == 2
    assert "none.mcap" in capsys.readouterr().err


@pytest.mark.real_data
def test_a_nearly_straight_drive_gives_a_wide_ratio_and_the_reason(
    data_dir: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    segment = data_dir / "drive-comma2k19-sf" / "segment40"
    assert run(["identify", str(segment), "--json"]) == 0
    ratio = json.loads(capsys.readouterr().out)["steering_ratio"]
    # A family car's, with the bundled wheelbase in place of its own.
    assert ratio["low"] < 17.0 < ratio["high"]
    assert ratio["high"] > 1.5 * ratio["low"]
    assert not ratio["taken"]
    assert "nearly straight" in ratio["reason"]
    assert "the interval is wide: play between steering wheel and tyres" in ratio["reason"]
