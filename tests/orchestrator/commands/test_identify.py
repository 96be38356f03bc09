"""`foretwin identify`: a table, an object, plots and a vehicle file."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path

import msgspec
import pytest

from foretwin.contracts.drive import ImuSample, SpeedSample
from foretwin.orchestrator.commands.cli import run
from foretwin.orchestrator.commands.identify import SHOWN
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.sim_worker.vehicle.plausible import PLAUSIBLE
from foretwin.telemetry.logs.write_mcap import create
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
    for found in told.values():
        assert set(found) == {"value", "low", "high", "reason"}
    for name in ("steering_ratio", "steering_delay_s"):
        found, given = told[name], getattr(load_vehicle(), name)
        expected = given.value if found["reason"] else found["value"]
        assert getattr(tuned, name).value == pytest.approx(expected)
    assert json.loads((out / "identification.json").read_text())["estimates"]
    assert tuned.steering_delay_s.source.startswith("identified from drive.mcap")


@pytest.mark.parametrize("positions", [True, False], ids=["with positions", "without"])
@pytest.mark.parametrize(("speed_gain", "gyro_gain"), [(1.0, 1.0), (3.6, 1.0), (1.0, -1.0)])
def test_what_has_a_star_is_what_the_file_holds(
    positions: bool,
    speed_gain: float,
    gyro_gain: float,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    log, out = tmp_path / "drive.mcap", tmp_path / "out"
    drive = whole_drive()
    with create(log, info=drive.source.info) as writer:
        for channel, message in drive.samples:
            if isinstance(message, SpeedSample):
                message = msgspec.structs.replace(message, speed_mps=speed_gain * message.speed_mps)
            if isinstance(message, ImuSample):
                rates = (*message.rate_radps[:2], gyro_gain * message.rate_radps[2])
                message = msgspec.structs.replace(message, rate_radps=rates)
            if channel != "plan" and (positions or channel != "gnss"):
                writer.add(channel, message)
    assert run(["identify", str(log), "--out", str(out)]) == 0
    table = capsys.readouterr().out
    rows = re.findall(r"^(\S.*?)  +.*\*$", table, re.MULTILINE)
    by_row = {"understeer gradient": "front_cornering_stiffness_npr"}
    by_row |= {row: name for name, (row, *_) in SHOWN.items() if row not in by_row}
    tuned = load_vehicle(out / "vehicle.toml")
    held = {name for name in PLAUSIBLE if "identified" in getattr(tuned, name).source}
    assert {by_row[row] for row in rows} == held
    faulty = speed_gain * gyro_gain != 1.0
    assert ("steering_ratio" not in held) is faulty
    assert ("disagrees with its positions" in table) is (faulty and positions)


def test_what_was_written_is_named_and_no_plot_that_was_not(
    log_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    blind = tmp_path / "drive.mcap"
    drive = whole_drive()
    with create(blind, info=drive.source.info) as writer:
        for channel, message in drive.samples:
            if isinstance(message, SpeedSample):
                writer.add(channel, message)
    for log, plots in ((log_file, ", estimates.png, steering.png"), (blind, "")):
        out = tmp_path / f"of {log.parent.name}"
        assert run(["identify", str(log), "--out", str(out)]) == 0
        named = f"{out}: vehicle.toml, identification.json{plots}"
        assert capsys.readouterr().out.splitlines()[-1] == named
        assert {one.name for one in out.iterdir()} == set(named.partition(": ")[2].split(", "))


def test_the_table_is_read_at_80_columns(
    log_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["identify", str(log_file)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= 80
    (ratio,) = (index for index, line in enumerate(lines) if line.startswith("steering ratio  "))
    assert re.match(r"steering ratio +15\.\d+ +1\d\.?\d* to 1\d\.?\d* +16", lines[ratio])
    (base,) = (index for index, line in enumerate(lines) if line.startswith("wheelbase"))
    assert lines[base].split() == ["wheelbase", "-", "m", "2.579"]
    assert lines[base + 1].startswith("    no tyre angle was measured: ")
    said = " ".join(lines)
    assert (
        "intervals hold given the file's bmw_320i: of the steering its wheelbase of 2.579" in said
    )


def test_a_declaration_that_lies_elsewhere_is_named(
    log_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table, declared = tmp_path / "drive.csv", tmp_path / "other" / "units.toml"
    assert run(["convert", str(log_file), str(table)]) == 0
    declared.parent.mkdir()
    table.with_name("drive.csv.toml").rename(declared)
    assert run(["identify", str(table)]) == 2
    capsys.readouterr()
    assert run(["identify", str(table), "--json", "--declaration", str(declared)]) == 0
    ratio = json.loads(capsys.readouterr().out)["steering_ratio"]
    assert ratio["value"] == pytest.approx(15.3, rel=0.05)


def _empty(folder: Path) -> list[str]:
    file = folder / "empty.mcap"
    with create(file, info=whole_drive().source.info):
        pass
    return [str(file)]


def _no_declaration(folder: Path) -> list[str]:
    file = folder / "drive.csv"
    file.write_text("t,v\n0,1\n", encoding="utf-8")
    return [str(file)]


def _standing(folder: Path) -> list[str]:
    """The first three seconds of a drive, its car held where it is."""
    file = folder / "standing.mcap"
    drive = whole_drive()
    with create(file, info=drive.source.info) as writer:
        for channel, message in drive.samples:
            if message.stamp_ns > drive.source.first_stamp_ns + 3_000_000_000:
                break
            if isinstance(message, SpeedSample):
                message = msgspec.structs.replace(message, speed_mps=0.0)
            if channel != "plan":
                writer.add(channel, message)
    return [str(file)]


@pytest.mark.parametrize(
    ("given", "told"),
    [
        (lambda folder: [str(folder / "none.mcap")], "none.mcap"),
        (_empty, "empty.mcap: "),
        (_no_declaration, "declar"),
        (_standing, "never goes faster than 0.0 m/s"),
    ],
    ids=["missing", "empty", "no declaration", "standing"],
)
def test_what_is_no_drive_is_said_in_one_line(
    given: Callable[[Path], list[str]],
    told: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert run(["identify", *given(tmp_path)]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    (line,) = printed.err.splitlines()
    assert told in line


def test_a_file_in_the_place_of_the_folder_is_said_at_once(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").touch()
    assert run(["identify", "none.mcap", "--out", str(tmp_path / "file")]) == 2
    assert capsys.readouterr().err == f"foretwin: --out {tmp_path / 'file'}: is no folder\n"


def test_an_unknown_vehicle_is_said_in_one_line(
    log_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["identify", str(log_file), "--vehicle", "no_such_car"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "no vehicle file no_such_car" in line


@pytest.mark.real_data
def test_a_nearly_straight_drive_gives_a_wide_ratio_and_the_reason(
    data_dir: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    segment = data_dir / "drive-comma2k19-sf" / "segment40"
    assert run(["identify", str(segment), "--json"]) == 0
    ratio = json.loads(capsys.readouterr().out)["steering_ratio"]
    # A family car's, with the bundled wheelbase in place of its own.
    assert ratio["low"] < 17.0 < ratio["high"]
    assert ratio["low"] < ratio["value"] < ratio["high"]
    assert ratio["high"] > 1.5 * ratio["low"]
    assert "nearly straight" in ratio["reason"]
    assert "the interval is wide: play between steering wheel and tyres" in ratio["reason"]
