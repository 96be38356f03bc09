"""`convert` to each kind of target, and back again, without loss."""

from __future__ import annotations

import math
import subprocess
import sys
from pathlib import Path

import msgspec
import pytest
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

from foretwin.contracts import drive
from foretwin.telemetry.logs import LogError, open_log
from foretwin.telemetry.logs.convert import Target, convert, target_of
from foretwin.telemetry.logs.log import Sample
from foretwin.telemetry.logs.write_mcap import create
from tests.telemetry.drive_messages import INFO, START_NS, every_channel
from tests.telemetry.test_drive_mcap import assert_same

COVERS = ("foretwin.telemetry.logs.write_csv",)

NAMES: dict[Target, str] = {"mcap": "out.mcap", "ros1": "out.bag", "ros2": "out", "csv": "out.csv"}


@pytest.fixture
def recorded(tmp_path: Path) -> Path:
    """A drive with every channel, as our own MCAP."""
    path = tmp_path / "in.mcap"
    with create(path, info=INFO) as writer:
        for channel, message in every_channel():
            writer.add(channel, message)
    return path


def samples_of(path: Path) -> list[Sample]:
    log = open_log(path)
    found = list(log.samples())
    assert not log.skipped
    return found


def assert_same_samples(before: list[Sample], after: list[Sample]) -> None:
    assert [channel for channel, _ in after] == [channel for channel, _ in before]
    for (_, message), (_, back) in zip(before, after, strict=True):
        assert_same(message, back)


@pytest.mark.parametrize("to", ["mcap", "ros1", "ros2"])
def test_every_channel_comes_back(recorded: Path, tmp_path: Path, to: Target) -> None:
    target = tmp_path / NAMES[to]
    report = convert(recorded, target)
    before = samples_of(recorded)
    assert sum(report.counts.values()) == len(before)
    assert_same_samples(before, samples_of(target))
    assert msgspec.structs.replace(
        open_log(target).info, end_stamp_ns=0
    ) == msgspec.structs.replace(INFO, end_stamp_ns=0)
    assert not list(tmp_path.glob("*.partial"))


@pytest.mark.parametrize("to", ["mcap", "ros1", "ros2"])
def test_rosbags_reads_every_message_of_a_bag(recorded: Path, tmp_path: Path, to: Target) -> None:
    target = tmp_path / NAMES[to]
    convert(recorded, target)
    with AnyReader([target]) as reader:
        kinds = {
            one.topic: type(reader.deserialize(data, one.msgtype)).__name__
            for one, _, data in reader.messages()
        }
    assert kinds["/foretwin/gnss"] == "sensor_msgs__msg__NavSatFix"
    assert kinds["/foretwin/plan"] == "autoware_planning_msgs__msg__Trajectory"
    assert kinds["/foretwin/control"] == "ackermann_msgs__msg__AckermannDriveStamped"
    if to == "ros2":
        assert [path.name for path in target.glob("*.db3")] == ["out.db3"]


def test_a_csv_holds_what_has_a_place_in_it_exactly(recorded: Path, tmp_path: Path) -> None:
    target = tmp_path / "out.csv"
    report = convert(recorded, target)
    kept = ("gnss", "imu", "speed", "heading", "steering", "control")
    before = [sample for sample in samples_of(recorded) if sample[0] in kept]
    assert_same_samples(before, samples_of(target))
    assert report.counts == dict.fromkeys(kept, 1)
    assert report.skipped == {
        f"{channel} has no place in a CSV": 1
        for channel in ("plan", "status", "objects", "signals")
    }
    info = open_log(target).info
    assert (info.time_base, info.reference_point) == ("utc", "antenna")
    assert info.body_from_antenna_m == (1.25, 0.0, 1.5)


def test_what_only_some_samples_have_is_left_out_of_a_csv_and_said(tmp_path: Path) -> None:
    path = tmp_path / "in.mcap"
    fix = every_channel()[0]
    with create(path, info=INFO) as writer:
        writer.add(*fix)
        for place, rate in enumerate((None, 0.5)):
            heading = drive.HeadingSample(
                stamp_ns=START_NS + 10 + place, yaw_rad=-0.5, yaw_rate_radps=rate
            )
            writer.add("heading", heading)
    report = convert(path, tmp_path / "out.csv")
    assert report.skipped == {"heading yaw_rate, which only some samples have": 1}
    back = [
        message for channel, message in samples_of(tmp_path / "out.csv") if channel == "heading"
    ]
    assert [one.yaw_rate_radps for one in back] == [None, None]  # type: ignore[attr-defined]
    assert [one.yaw_rad for one in back] == [pytest.approx(-0.5)] * 2  # type: ignore[attr-defined]


def test_a_csv_without_positions_is_refused_and_nothing_is_left(tmp_path: Path) -> None:
    path = tmp_path / "in.mcap"
    with create(path, info=INFO) as writer:
        writer.add("speed", drive.SpeedSample(stamp_ns=START_NS, speed_mps=8.0))
    with pytest.raises(LogError, match="a CSV needs positions"):
        convert(path, tmp_path / "out.csv")
    assert [one.name for one in tmp_path.iterdir()] == ["in.mcap"]


@pytest.mark.parametrize("to", ["mcap", "ros1", "ros2", "csv"])
def test_nothing_is_left_behind_where_nothing_is_valid(tmp_path: Path, to: Target) -> None:
    source = tmp_path / "gt.txt"
    source.write_text("point3 0.5 0 0 0\n")
    with pytest.raises(LogError, match=r"gt\.txt: holds no valid sample \(1 x position not fin"):
        convert(source, tmp_path / "anything", to=to)
    assert [path.name for path in tmp_path.iterdir()] == ["gt.txt"]


def test_the_name_tells_the_kind_of_target(recorded: Path, tmp_path: Path) -> None:
    for kind, name in NAMES.items():
        assert target_of(tmp_path / name) == kind
    with pytest.raises(LogError, match=r"unknown suffix '\.xml'; \.mcap, \.bag"):
        convert(recorded, tmp_path / "out.xml")
    (tmp_path / "there").mkdir()
    with pytest.raises(LogError, match="there: exists"):
        convert(recorded, tmp_path / "there")


def test_nmea_becomes_a_bag(tmp_path: Path) -> None:
    source = tmp_path / "drive.nmea"
    source.write_text("$GPRMC,120000.00,A,5230.6,N,01323.4,E,10.0,0.0,010326,,,A\n")
    convert(source, tmp_path / "bag")
    assert_same_samples(samples_of(source), samples_of(tmp_path / "bag"))
    heading = dict(samples_of(tmp_path / "bag"))["heading"]
    assert heading.yaw_rad == pytest.approx(0.5 * math.pi)  # type: ignore[attr-defined]


def test_the_mcap_package_reads_what_was_a_bag(recorded: Path, tmp_path: Path) -> None:
    convert(recorded, tmp_path / "bag")
    convert(tmp_path / "bag", tmp_path / "again.mcap")
    with (tmp_path / "again.mcap").open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        topics = {channel.topic for _, channel, _ in reader.iter_messages()}
    assert {"/foretwin/gnss", "/foretwin/plan", "/foretwin/control_json"} <= topics


@pytest.mark.judge
def test_rerun_converts_what_was_a_bag(recorded: Path, tmp_path: Path) -> None:
    convert(recorded, tmp_path / "drive.bag")
    convert(tmp_path / "drive.bag", tmp_path / "again.mcap")
    rerun, rrd = Path(sys.executable).with_name("rerun"), tmp_path / "again.rrd"
    done = subprocess.run(
        [rerun, "mcap", "convert", str(tmp_path / "again.mcap"), "-o", str(rrd)],
        capture_output=True,
        text=True,
        timeout=240,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert rrd.stat().st_size > 1000
