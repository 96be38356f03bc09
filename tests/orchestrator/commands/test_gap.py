"""`foretwin gap`: a table, plots, a verdict; and one line for what is no drive."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pytest

from foretwin.contracts.drive import GnssFix, SpeedSample, VehicleInfo
from foretwin.contracts.frames import GeoPoint
from foretwin.orchestrator.commands import gap
from foretwin.orchestrator.commands.cli import run
from foretwin.orchestrator.commands.gap import gap_of
from foretwin.orchestrator.commands.gap_text import moved_lines
from foretwin.telemetry.logs.write_mcap import create
from foretwin.telemetry.ros_messages.table import messages_from
from tests.sim_worker.analysis.gap.measured_figures import Lateness, hand_driven
from tests.sim_worker.analysis.gap.test_verdict import END_S, SEED
from tests.sim_worker.faulty_standin import drive_of, said_as
from tests.telemetry.standin_drive import FRAME

COVERS = (
    "foretwin.orchestrator.commands.cli_logs",
    "foretwin.orchestrator.commands.gap_plots",
    "foretwin.orchestrator.commands.gap_text",
)

WIDTH = 80
BY_HAND = 300


def written(file: Path, info: VehicleInfo, samples: Iterable[tuple[str, Any]]) -> Path:
    with create(file, info=info) as writer:
        for channel, message in samples:
            writer.add(channel, message)
    return file


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A drive whose steering sensor sends degrees."""
    drive = drive_of(SEED, "steering_read_in_degrees", end_s=END_S)
    return written(tmp_path_factory.mktemp("gap") / "drive.mcap", drive.info, drive.samples)


def test_the_verdict_names_degrees_in_json(
    recording: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["gap", str(recording), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["independent"] is True
    assert {row["horizon_s"] for row in said["rows"]} == {1.0, 2.0, 4.0, 8.0}
    assert {row["manoeuvre"] for row in said["rows"]} >= {"straight", "curve", "accelerating"}
    for row in said["rows"]:
        assert set(row["rms"]) == set(row["p95"]) == {
            "position_m", "along_m", "across_m", "yaw_rad", "yaw_rate_radps", "speed_mps",
            "accel_mps2",
        }  # fmt: skip
        assert row["rms"]["position_m"] >= row["rms"]["along_m"] >= 0.0
    first = said["verdicts"][0]
    assert (first["culprit"], first["cause"]) == ("vehicle", "steering_in_degrees")
    assert first["evidence"][0]["expected"] == 1.0
    assert first["since_stamp_ns"] < first["stamp_ns"]
    assert said["reason"] is None


def test_the_table_is_80_columns_wide_and_plots_are_written(
    recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["gap", str(recording), "--vehicle", "bmw_320i", "--out", str(tmp_path / "p")]) == 0
    said = capsys.readouterr().out
    assert "real vehicle, steering_in_degrees" in said
    table = [line for line in said.splitlines() if not line.startswith("wrote ")]
    assert max(map(len, table)) <= WIDTH
    assert sum(" s curve" in line for line in table) >= 2
    for name in ("gap_over_time.png", "gap_by_horizon.png"):
        assert (tmp_path / "p" / name).read_bytes().startswith(b"\x89PNG")


def positions_alone(folder: Path) -> Path:
    drive = drive_of(SEED, end_s=END_S)
    quiet = (sample for sample in drive.samples if sample[0] not in ("control", "steering"))
    return written(folder / "quiet.mcap", drive.info, quiet)


def test_without_commands_and_steering_it_says_that_nobody_can_be_accused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = positions_alone(tmp_path)
    assert run(["gap", str(file)]) == 0
    said = capsys.readouterr().out
    assert "commands were not recorded" in said
    why = "steering, speed and gyro were not all measured"
    assert f"the model was not driven by what was measured: {why}" in " ".join(said.split())
    assert "verdict" not in said
    assert run(["gap", str(file), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["reason"].startswith("commands were not recorded")
    assert (told["independent"], told["driven_by"]) == (False, "estimated commands")
    assert (told["turning"], told["turning_not_held"]) == (None, why)
    assert told["rows"]
    assert told["verdicts"] == []


def test_a_car_driven_by_hand_is_followed_at_its_measured_steering_and_speed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    # The same file is told of twice, and measured once.
    reports: list[gap.GapReport] = []

    def once(*what: Any, **how: Any) -> gap.GapReport:
        reports.extend([] if reports else [gap_of(*what, **how)])
        return reports[0]

    monkeypatch.setattr(gap, "gap_of", once)
    drive = drive_of(BY_HAND, end_s=60.0)
    file = written(tmp_path / "hand.mcap", drive.info, hand_driven(BY_HAND, Lateness(), end_s=60.0))
    assert run(["gap", str(file), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["independent"], told["driven_by"]) == (True, "measured steering and speed")
    assert told["reason"].startswith("commands were not recorded: the model was driven by steering")
    turning = told["turning"]
    assert told["turning_not_held"] is None
    assert turning["within_share"] >= 0.85
    assert turning["clock_late_s"]["steering"]["half_95"] < 0.02
    assert abs(turning["clock_late_s"]["steering"]["value"]) < 0.01
    assert "wheelbase, tyres and inertia" in turning["conditional_on"]
    assert max(row["rms"]["across_m"] for row in told["rows"] if row["horizon_s"] == 2.0) < 0.5

    assert run(["gap", str(file)]) == 0
    said = capsys.readouterr().out
    assert max(map(len, said.splitlines())) <= WIDTH
    assert "after the gyro, given the model's" in said
    assert "nobody is accused" in said
    for word in ("verdict", "obeys its commands", "sure 0%"):
        assert word not in said


def test_a_speed_half_a_second_late_accuses_nobody_and_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    late = said_as(SpeedSample, lambda m: {"stamp_ns": m.stamp_ns + 500_000_000})
    drive = drive_of(BY_HAND, end_s=60.0).with_fault(late)
    file = written(tmp_path / "late.mcap", drive.info, drive.samples)
    assert run(["gap", str(file), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["driven_by"], told["verdicts"]) == ("commands", [])
    assert told["moved_s"] == {"speed": pytest.approx(0.48, abs=0.03)}
    (line, _) = moved_lines(told["moved_s"])
    assert line.strip().startswith("stamped late, and judged without that: speed by +")


def test_a_gyro_that_is_off_is_told_in_json(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    drive = drive_of(SEED, "offset_gyro", end_s=8.0)
    file = written(tmp_path / "gyro.mcap", drive.info, drive.samples)
    assert run(["gap", str(file), "--json"]) == 0
    (verdict, *_) = json.loads(capsys.readouterr().out)["verdicts"]
    assert (verdict["cause"], verdict["evidence"][0]["name"]) == ("gyro_sensor", "gyro_offset")


def test_dirt_is_counted_said_and_survived(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """NaN, jumps of 500 m, time that runs back, and a topic that becomes one of another type."""
    drive = drive_of(SEED, end_s=END_S)
    north = GeoPoint(FRAME.origin.lat_deg + 0.0045, FRAME.origin.lon_deg)
    file = tmp_path / "dirty.mcap"
    with create(file, info=drive.info) as writer:
        for index, (channel, message) in enumerate(drive.samples):
            writer.add(channel, message)
            stamp_ns = message.stamp_ns
            if index % 500 == 7:
                writer.add("speed", SpeedSample(stamp_ns=stamp_ns + 1, speed_mps=float("nan")))
            if index % 900 == 99:
                writer.add("gnss", GnssFix(stamp_ns=stamp_ns + 3, position=north, std_m=0.02))
        ((topic, _, data),) = messages_from("speed", SpeedSample(stamp_ns=1, speed_mps=1.0), None)
        del writer._ids[topic, 0]
        writer._writer.add_message(
            channel_id=writer._channel_id(topic, "sensor_msgs/msg/Imu", 0),
            log_time=stamp_ns, publish_time=stamp_ns, data=data,
        )  # fmt: skip
        early = SpeedSample(stamp_ns=drive.info.start_stamp_ns, speed_mps=3.0)
        del writer._ids[topic, 0]
        writer.add("speed", early)
    assert run(["gap", str(file), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["verdicts"] == []
    left_open = "beyond what parameters leave open"
    assert said["reason"] == f"nothing shows that car or model departs {left_open}"
    assert said["refused"]["value not finite"] >= 5
    assert said["refused"]["topic changed its type"] == 1
    assert sum(count for reason, count in said["refused"].items() if "time" in reason) == 1


def test_what_is_no_drive_is_said_in_one_line(
    recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "empty.mcap").touch()
    (tmp_path / "table.csv").write_text("t,lat,lon\n0,52.5,13.4\n", encoding="utf-8")
    drive = drive_of(SEED, end_s=END_S)
    speeds = [sample for sample in drive.samples if sample[0] == "speed"][:100]
    written(tmp_path / "speeds.mcap", drive.info, speeds)
    (tmp_path / "file").touch()
    cases = (
        ("none.mcap", [str(tmp_path / "none.mcap")]),
        ("empty.mcap", [str(tmp_path / "empty.mcap")]),
        ("table.csv", [str(tmp_path / "table.csv")]),
        ("speeds.mcap", [str(tmp_path / "speeds.mcap")]),
        ("none.toml", [str(tmp_path / "table.csv"), "--declaration", str(tmp_path / "none.toml")]),
        ("spaceship", [str(recording), "--vehicle", "spaceship"]),
        ("file: is no folder", [str(recording), "--out", str(tmp_path / "file")]),
    )
    for named, words in cases:
        assert run(["gap", *words]) == 2
        (line,) = capsys.readouterr().err.strip().splitlines()
        assert named in line


@pytest.mark.parametrize("speed_late_ns", [None, 402_000_000])
def test_a_logger_of_a_row_a_second_is_told_that_its_rows_are_too_far_apart(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], speed_late_ns: int | None
) -> None:
    rows: list[tuple[str, Any]] = []
    for k in range(40):
        place = GeoPoint(52.5 + 1e-4 * k, 13.4)
        rows.append(("gnss", GnssFix(stamp_ns=k * 10**9, position=place)))
        if speed_late_ns is not None and k < 39:
            late_ns = k * 10**9 + speed_late_ns
            rows.append(("speed", SpeedSample(stamp_ns=late_ns, speed_mps=11.1)))
    info = VehicleInfo(vehicle_id="car", time_base="log", start_stamp_ns=0, end_stamp_ns=39 * 10**9)
    assert run(["gap", str(written(tmp_path / "rows.mcap", info, rows))]) == 2
    apart_s = 1.0 if speed_late_ns is None else 0.6
    assert f"its samples come {apart_s} s apart" in capsys.readouterr().err
