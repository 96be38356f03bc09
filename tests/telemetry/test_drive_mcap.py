"""A drive written to MCAP comes back equal, here and in other programs."""

from __future__ import annotations

import dataclasses
import subprocess
import sys
from collections import Counter
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from mcap.reader import NonSeekingReader, make_reader
from mcap.writer import CompressionType, Writer
from rosbags.highlevel import AnyReader

from foretwin.contracts import drive
from foretwin.contracts.frames import GeoPoint, LocalFrame
from foretwin.contracts.keys import TELEMETRY_CHANNELS
from foretwin.telemetry.logs import LogError, mcap_records, open_log
from foretwin.telemetry.logs.convert import convert
from foretwin.telemetry.logs.mcap_records import MOST_CHUNK_BYTES
from foretwin.telemetry.logs.ros_recording import decoder, mcap_recording
from foretwin.telemetry.logs.write_mcap import create
from foretwin.telemetry.ros_messages.table import TOPIC_PREFIX, messages_from
from tests.telemetry.drive_messages import INFO, START_NS, every_channel, samples
from tests.telemetry.own_recordings import message_from, read_drive

COVERS = (
    "foretwin.telemetry.logs.ros_log",
    "foretwin.telemetry.logs.write_mcap",
    "foretwin.telemetry.logs.mcap_records",
    "foretwin.telemetry.ros_messages.table",
    "foretwin.telemetry.ros_messages.sensors",
)

FRAME = LocalFrame(GeoPoint(52.5, 13.4))


def assert_same(first: object, second: object) -> None:
    """Exact but for angles and plans: 1e-9 of a degree, a nanosecond, 32 bits of speed."""
    assert type(first) is type(second)
    if isinstance(first, drive.PlannedTrajectory) and isinstance(second, drive.PlannedTrajectory):
        assert first.stamp_ns == second.stamp_ns
        np.testing.assert_allclose(second.lat_deg, first.lat_deg, atol=1e-9, rtol=0)
        np.testing.assert_allclose(second.lon_deg, first.lon_deg, atol=1e-9, rtol=0)
        np.testing.assert_allclose(second.yaw_rad, first.yaw_rad, atol=1e-9, rtol=0)
        np.testing.assert_allclose(
            second.time_from_stamp_s, first.time_from_stamp_s, atol=1.1e-9, rtol=0
        )
        np.testing.assert_allclose(second.speed_mps, first.speed_mps, rtol=1e-6, atol=1e-30)
    elif isinstance(first, drive.HeadingSample) and isinstance(second, drive.HeadingSample):
        assert second.yaw_rad == pytest.approx(first.yaw_rad, abs=1e-14)
        assert (second.stamp_ns, second.yaw_rate_radps) == (first.stamp_ns, first.yaw_rate_radps)
    elif isinstance(first, drive.GnssFix) and isinstance(second, drive.GnssFix):
        assert (second.stamp_ns, second.position) == (first.stamp_ns, first.position)
        assert second.std_m == (None if first.std_m is None else pytest.approx(first.std_m))
    else:
        assert second == first


@settings(max_examples=150, deadline=None)
@given(samples)
def test_every_message_survives_ros(sample: tuple[str, msgspec.Struct]) -> None:
    channel, message = sample
    back = [
        found
        for part in messages_from(channel, message, FRAME)
        if (found := message_from(part.topic, part.data, FRAME)) is not None
    ]
    assert [name for name, _ in back] == [channel], "one message is read, views are not"
    assert_same(message, back[0][1])


def test_all_of_telemetry_can_be_written() -> None:
    assert {channel for channel, _ in every_channel()} == {*TELEMETRY_CHANNELS, "state"}
    for channel, message in every_channel():
        assert messages_from(channel, message, FRAME)


def write(path: Path, messages: list[tuple[str, msgspec.Struct]]) -> Path:
    with create(path, info=INFO) as writer:
        for channel, message in messages:
            writer.add(channel, message)
    return path


@pytest.fixture
def recorded(tmp_path: Path) -> Path:
    return write(tmp_path / "drive.mcap", every_channel())


def test_a_drive_comes_back_with_what_is_known_of_the_vehicle(recorded: Path) -> None:
    log = open_log(recorded)
    assert log.info == msgspec.structs.replace(INFO, end_stamp_ns=START_NS + 11)
    kept = [item for item in every_channel() if item[0] not in ("state", "end")]
    found = list(log.samples())
    assert [channel for channel, _ in found] == [channel for channel, _ in kept]
    for (_, before), (_, after) in zip(kept, found, strict=True):
        assert_same(before, after)
    assert not log.skipped


def test_states_and_the_end_are_there_for_those_who_ask(recorded: Path) -> None:
    found = list(read_drive(recorded))
    assert [channel for channel, _ in found] == [channel for channel, _ in every_channel()]
    for (_, before), (_, after) in zip(every_channel(), found, strict=True):
        assert_same(before, after)


def test_the_mcap_package_reads_it_whole_with_crcs(recorded: Path) -> None:
    with recorded.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        assert reader.get_header().profile == "ros2"
        topics = {channel.topic for _, channel, _ in reader.iter_messages()}
    assert {"/foretwin/gnss", "/foretwin/control", "/foretwin/state"} < topics
    with recorded.open("rb") as file:
        for schema, channel, message in NonSeekingReader(file, validate_crcs=True).iter_messages():
            assert schema is not None
            assert (schema.encoding, channel.message_encoding) == ("ros2msg", "cdr")
            assert message.log_time >= START_NS


def test_rosbags_reads_it_back_equal(recorded: Path) -> None:
    with recorded.open("rb") as file:
        ours = [(c.topic, m.log_time, m.data) for _, c, m in make_reader(file).iter_messages()]
    theirs, decoded = [], {}
    with AnyReader([recorded]) as reader:
        for connection, time_ns, data in reader.messages():
            theirs.append((connection.topic, time_ns, bytes(data)))
            decoded[connection.topic] = reader.deserialize(data, connection.msgtype)
    assert sorted(theirs) == sorted(ours)
    fix: Any = decoded["/foretwin/gnss"]
    assert (fix.latitude, fix.longitude, fix.altitude) == (52.512, 13.392, 75.0)
    command: Any = decoded["/foretwin/control"]
    assert command.drive.acceleration == 0.5
    plan: Any = decoded["/foretwin/plan"]
    assert len(plan.points) == 80
    assert plan.points[-1].longitudinal_velocity_mps == pytest.approx(8.3)


def test_a_file_cut_short_is_read_to_where_it_breaks(tmp_path: Path) -> None:
    path = tmp_path / "killed.mcap"
    writer = create(path, info=INFO)
    for number in range(100):
        writer.add("speed", drive.SpeedSample(stamp_ns=START_NS + number, speed_mps=float(number)))
    writer.flush()
    writer.add("speed", drive.SpeedSample(stamp_ns=START_NS + 100, speed_mps=100.0))
    # As SIGKILL leaves it: no end, no index; and then torn in the middle of a record.
    path.write_bytes(path.read_bytes()[:-3])
    log = open_log(path)
    assert [m.speed_mps for _, m in log.samples()] == [float(n) for n in range(100)]  # type: ignore[attr-defined]
    assert log.skipped == {"file cut short": 1}
    assert log.info.vehicle_id == INFO.vehicle_id
    writer.finish()


def test_damage_is_told(recorded: Path) -> None:
    data = bytearray(recorded.read_bytes())
    with recorded.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    chunk = summary.chunk_indexes[0]
    middle = chunk.chunk_start_offset + chunk.chunk_length // 2
    data[middle] ^= 0xFF
    recorded.write_bytes(data)
    with pytest.raises(LogError, match=r"drive\.mcap: damaged MCAP"):
        list(open_log(recorded).samples())


def test_a_definition_that_is_missing_or_not_that_of_ros_is_told(recorded: Path) -> None:
    recording = mcap_recording(recorded)
    schemas = recording.contents.schemas
    speed = f"{TOPIC_PREFIX}speed"
    with pytest.raises(LogError, match=r"topic /none: the file does not say of what type"):
        decoder(recording, {speed, "/none"})
    other = schemas[speed].data.replace(b"uint32 nanosec", b"uint64 nanosec")
    changed = dataclasses.replace(schemas[speed], data=other)
    contents = recording.contents._replace(schemas={**schemas, speed: changed})
    with pytest.raises(LogError, match=r"drive\.mcap: unreadable definitions: .*already present"):
        decoder(dataclasses.replace(recording, contents=contents), {speed})


def test_a_bag_of_ours_whose_account_of_itself_is_damaged_is_refused(recorded: Path) -> None:
    path = recorded.with_name("own.bag")
    convert(recorded, path)
    path.write_bytes(path.read_bytes().replace(b'{"vehicle_id"', b'{"\xf5ehicle_id"'))
    with pytest.raises(LogError, match=r"own\.bag: its /foretwin/\w+ is damaged: "):
        open_log(path)


def test_an_index_that_points_before_the_file_is_told(
    recorded: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recording = mcap_recording(recorded)

    def refuses(*_args: object, **_named: object) -> object:
        raise OSError(22, "Invalid argument")

    monkeypatch.setattr(mcap_records, "make_reader", refuses)
    with pytest.raises(LogError, match=r"drive\.mcap: damaged MCAP: OSError"):
        list(recording.read({f"{TOPIC_PREFIX}speed"}, Counter()))


def test_what_is_not_a_number_is_refused_on_reading(tmp_path: Path) -> None:
    nan = float("nan")
    path = write(
        tmp_path / "drive.mcap",
        [
            ("gnss", drive.GnssFix(stamp_ns=START_NS, position=GeoPoint(nan, 13.0))),
            ("gnss", drive.GnssFix(stamp_ns=START_NS + 1, position=GeoPoint(0.0, 0.0))),
            ("gnss", drive.GnssFix(stamp_ns=START_NS + 2, position=GeoPoint(52.5, 13.4))),
            ("control", drive.ControlCommand(stamp_ns=START_NS, accel_mps2=nan)),
        ],
    )
    log = open_log(path)
    assert [message.stamp_ns for _, message in log.samples()] == [START_NS + 2]  # type: ignore[attr-defined]
    assert log.skipped == {"position not finite": 1, "position (0, 0)": 1, "value not finite": 1}


def test_stamps_that_no_ros_time_holds_are_refused() -> None:
    for stamp_ns in (-1, 2**31 * 10**9):
        with pytest.raises(ValueError, match="fits no ROS time"):
            messages_from("speed", drive.SpeedSample(stamp_ns=stamp_ns, speed_mps=1.0), None)


@pytest.mark.judge
def test_rerun_converts_it(recorded: Path, tmp_path: Path) -> None:
    rrd = tmp_path / "drive.rrd"
    rerun = Path(sys.executable).with_name("rerun")
    done = subprocess.run(
        [rerun, "mcap", "convert", str(recorded), "-o", str(rrd)],
        capture_output=True,
        text=True,
        timeout=240,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert rrd.stat().st_size > 1000
    for topic in ("gnss", "imu", "steering", "control", "plan", "state"):
        assert f"/foretwin/{topic}" in done.stderr + done.stdout


@pytest.mark.parametrize("cut_bytes", [0, 20])
def test_a_chunk_that_unpacks_to_far_more_than_any_log_is_refused(
    tmp_path: Path, cut_bytes: int
) -> None:
    path = tmp_path / "bomb.mcap"
    most = MOST_CHUNK_BYTES + 2**20
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=2 * most, compression=CompressionType.ZSTD)
        writer.start()
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data")
        channel = writer.register_channel("/t", "cdr", schema)
        writer.add_message(channel, log_time=1, data=bytes(most), publish_time=1)
        writer.finish()  # type: ignore[no-untyped-call]
    path.write_bytes(path.read_bytes()[: path.stat().st_size - cut_bytes])

    with pytest.raises(LogError, match=r"a chunk of \d+ bytes unpacks to \d+: no log is packed"):
        open_log(path)
