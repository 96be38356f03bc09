"""A recording survives what disks do."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import NonSeekingReader

from foretwin.contracts.drive import DriveEnd, ImuSample, SpeedSample
from foretwin.contracts.segments import segments_of
from foretwin.contracts.tally import read_tally, tally_file
from foretwin.telemetry.logs import open_log
from foretwin.telemetry.logs.write_mcap import create
from foretwin.telemetry.processes import recording as module
from foretwin.telemetry.processes.recording import RETRY_S, DriveRecording
from tests.telemetry.drive_messages import INFO, START_NS, every_channel
from tests.telemetry.own_recordings import read_drive
from tests.telemetry.processes.small_disk import Disk

COVERS = ("foretwin.telemetry.logs.write_mcap",)


def kill(recording: DriveRecording) -> None:
    """Leave the file as a kill does: what waits in the chunk in progress is gone."""
    assert recording._writer is not None
    recording._writer._raw.close()


def imu(number: int) -> ImuSample:
    # Irregular numbers, so that they do not compress away.
    accel = tuple(((number * factor) % 1009) / 7.0 for factor in (613, 389, 997))
    return ImuSample(stamp_ns=START_NS + number, accel_mps2=accel, rate_radps=accel)  # type: ignore[arg-type]


def recorded(path: Path) -> list[ImuSample]:
    """Return what all parts hold, in the order of the files."""
    return [message for part in segments_of(path) for _, message in read_drive(part)]  # type: ignore[misc]


def balances(recording: DriveRecording) -> bool:
    tally = recording.tally
    known = Counter(tally.recorded) + Counter(tally.unwritten) + Counter(tally.refused)
    return tally.numbers.published == known + tally.numbers.missing


@pytest.mark.parametrize("room", [40, 900, 60_000, 100_000])
def test_a_disk_that_stays_full_is_told_once_and_what_was_written_stays_readable(
    tmp_path: Path, room: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "MOST_WAITING", 1000)
    path, disk = tmp_path / "drive.mcap", Disk(room)
    recording = DriveRecording(path, open_part=disk.open_part, mono_s=disk.clock)
    events = list(recording.started())
    for number in range(6000):
        disk.now_s += 0.01
        events += recording.add("imu", imu(number))
        if number % 500 == 0:
            events += recording.flush()
    events += recording.finish()
    assert [(event.level, event.source) for event in events] == [("error", "recorder")]
    assert "drive.mcap cannot be written: No space left on device" in events[0].text
    assert recording.tally.unwritten["imu"] > 0
    assert balances(recording)
    assert segments_of(path) == [path]
    if room >= 60_000:
        found = recorded(path)
        assert 1000 < len(found) < 6000
        assert found == [imu(number) for number in range(len(found))]
        assert recording.tally.recorded == {"imu": len(found)}
        with path.open("rb") as file:
            assert len(list(NonSeekingReader(file).iter_messages())) == len(found)


def test_a_disk_that_has_room_again_takes_all_that_waited(tmp_path: Path) -> None:
    path, disk = tmp_path / "drive.mcap", Disk(60_000)
    recording = DriveRecording(path, open_part=disk.open_part, mono_s=disk.clock)
    events = []
    for number in range(6000):
        disk.now_s += 0.005
        if number == 4500:
            disk.room = None
        events += recording.add("imu", imu(number))
        if number % 200 == 0:
            events += recording.flush()
    events += recording.finish()
    assert [event.level for event in events] == ["error", "warning"]
    assert events[1].text.startswith("drive-002.mcap: the recording goes on; 0 messages")
    assert [part.name for part in segments_of(path)] == ["drive.mcap", "drive-002.mcap"]
    assert recorded(path) == [imu(number) for number in range(6000)]
    assert recording.tally.recorded == {"imu": 6000}
    assert recording.tally.unwritten == {}
    assert balances(recording)


def test_what_waited_too_long_is_counted_and_the_newest_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "MOST_WAITING", 100)
    path, disk = tmp_path / "drive.mcap", Disk(0)
    recording = DriveRecording(path, open_part=disk.open_part, mono_s=disk.clock)
    for number in range(250):
        recording.add("imu", imu(number))
    disk.room, disk.now_s = None, RETRY_S
    (event,) = recording.flush()
    assert "150 messages could not be written" in event.text
    recording.finish()
    assert recorded(path) == [imu(number) for number in range(150, 250)]
    assert (recording.tally.recorded, recording.tally.unwritten) == ({"imu": 100}, {"imu": 150})
    assert balances(recording)


@given(
    steps=st.lists(
        st.sampled_from(["add", "flush", "full", "free", "wait", "skip", "twice"]), max_size=60
    )
)
def test_the_tally_balances_and_says_what_the_files_hold(
    steps: list[str], tmp_path_factory: pytest.TempPathFactory
) -> None:
    path, disk = tmp_path_factory.mktemp("drive") / "drive.mcap", Disk(None)
    recording = DriveRecording(path, open_part=disk.open_part, mono_s=disk.clock)
    number = 0
    for step in steps:
        match step:
            case "add":
                recording.add("imu", imu(number), sender=7, seq=number)
                number += 1
            case "twice":
                recording.add("imu", imu(max(number - 1, 0)), sender=7, seq=max(number - 1, 0))
                number = max(number, 1)
            case "skip":
                number += 1
            case "flush":
                recording.flush()
            case "full":
                disk.room = 500
            case "free":
                disk.room = None
            case "wait":
                disk.now_s += RETRY_S
    recording.finish()
    found = recorded(path)
    assert balances(recording)
    assert len(found) == len({one.stamp_ns for one in found})
    assert recording.tally.recorded.get("imu", 0) == len(found)


def test_who_goes_on_with_a_recording_takes_nothing_twice(tmp_path: Path) -> None:
    path = tmp_path / "drive.mcap"
    killed = DriveRecording(path)
    for number in range(100):
        killed.add("imu", imu(number), sender=7, seq=number)
        if number == 79:
            killed.flush()
    kill(killed)
    again = DriveRecording(path)
    for number in range(50, 200):  # what the sender has kept, and what follows
        again.add("imu", imu(number), sender=7, seq=number)
    again.finish()
    assert [part.name for part in segments_of(path)] == ["drive.mcap", "drive-002.mcap"]
    assert recorded(path) == [imu(number) for number in range(200)]
    assert again.tally.recorded == {"imu": 200}
    assert balances(again)
    assert read_tally(tally_file(path)) == again.tally


@pytest.mark.parametrize("flushed", [0, 80])
def test_what_was_written_after_the_last_tally_is_not_taken_twice(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, flushed: int
) -> None:
    path = tmp_path / "drive.mcap"
    killed = DriveRecording(path)
    killed.add("imu", imu(1000), sender=5, seq=0)  # of a car that was started again since
    killed.add("speed", SpeedSample(stamp_ns=START_NS, speed_mps=1.0), sender=7, seq=0)
    for number in range(100):
        killed.add("imu", imu(number), sender=7, seq=number)
        if number == flushed:
            killed.flush()
    with monkeypatch.context() as starved:  # killed before it came to write its tally
        starved.setattr(module, "write_tally", lambda *_: None)
        killed.flush()
    kill(killed)
    again = DriveRecording(path)
    for number in range(50, 200):
        again.add("imu", imu(number), sender=7, seq=number)
    again.finish()
    found = Counter(message.stamp_ns - START_NS for message in recorded(path))
    assert found == Counter([0, *range(200), 1000])
    assert again.tally.recorded == {"imu": 201, "speed": 1}
    assert balances(again)


def test_what_a_killed_recorder_had_and_nobody_has_any_more_is_missing(tmp_path: Path) -> None:
    path = tmp_path / "drive.mcap"
    killed = DriveRecording(path)
    for number in range(10):
        killed.add("imu", imu(number), sender=7, seq=number)
    killed.flush()
    killed.add("imu", imu(10), sender=7, seq=10)
    kill(killed)
    again = DriveRecording(path)
    again.add("imu", imu(12), sender=7, seq=12)
    end = DriveEnd(stamp_ns=START_NS + 20, published={"imu": 15, "speed": 3})
    again.add("end", end, sender=7, seq=0)
    again.finish()
    assert again.tally.numbers.missing == {"imu": 4, "speed": 3, "end": 0}
    assert again.tally.numbers.published["imu"] == 15
    assert balances(again)


def test_of_what_is_no_sample_of_a_vehicle_nothing_is_missing(tmp_path: Path) -> None:
    recording = DriveRecording(tmp_path / "drive.mcap")
    said = {"wheel_ticks": 500, "real_cloud": 90, "end": 3, "": 7, "speed": 2}
    recording.add("end", DriveEnd(stamp_ns=START_NS, published=said), sender=7, seq=0)
    recording.finish()
    assert recording.tally.numbers.missing == {"speed": 2, "end": 0}  # none is asked for by name


def test_what_the_guard_does_not_let_in_is_counted_once(tmp_path: Path) -> None:
    recording = DriveRecording(tmp_path / "drive.mcap")
    recording.add("imu", imu(0), sender=7, seq=0)
    for _ in range(2):
        recording.refuse("imu", sender=7, seq=1)
    recording.finish()
    assert (recording.tally.recorded, recording.tally.refused) == ({"imu": 1}, {"imu": 1})
    assert balances(recording)


def test_a_part_that_was_cut_short_and_one_with_nothing_in_it_do_not_hide_the_others(
    tmp_path: Path,
) -> None:
    path = tmp_path / "drive.mcap"
    first = DriveRecording(path)  # killed before the vehicle said what it is
    first.add("imu", imu(0), sender=7, seq=0)
    first.flush()
    kill(first)
    empty = create(tmp_path / "drive-002.mcap", part=2)
    empty.finish()
    last = DriveRecording(path)
    last.set_info(INFO)
    last.add("imu", imu(1), sender=7, seq=1)
    last.finish()
    foreign = create(tmp_path / "drive-004.mcap")  # no part of this drive
    foreign.add("imu", imu(2))
    foreign.finish()
    log = open_log(path)
    assert [message for _, message in log.samples()] == [imu(0), imu(1)]
    assert log.info.body_from_antenna_m == INFO.body_from_antenna_m


def test_a_folder_that_is_not_there_stops_the_recording_alone(tmp_path: Path) -> None:
    recording = DriveRecording(tmp_path / "missing" / "drive.mcap")
    (event,) = recording.started()
    assert event.level == "error"
    assert "cannot be written" in event.text
    assert recording.add("imu", imu(0)) == []
    assert recording.set_info(INFO) == recording.flush() == recording.finish() == []
    assert recording.tally.unwritten == {"imu": 1}


def test_every_channel_is_recorded(tmp_path: Path) -> None:
    path = tmp_path / "drive.mcap"
    recording = DriveRecording(path)
    for channel, message in every_channel():
        assert recording.add(channel, message) == []
    assert recording.finish() == []
    assert [channel for channel, _ in read_drive(path)] == [c for c, _ in every_channel()]


@pytest.mark.parametrize("count", [2, 3000])
def test_messages_that_no_file_can_hold_are_counted_and_told_once(
    tmp_path: Path, count: int
) -> None:
    recording = DriveRecording(tmp_path / "drive.mcap")
    impossible = SpeedSample(stamp_ns=-5, speed_mps=1.0)
    (event,) = recording.add("speed", impossible)
    assert event.level == "warning"
    for _ in range(count - 1):
        assert recording.add("speed", impossible) == []
    assert recording.add("speed", SpeedSample(stamp_ns=5, speed_mps=1.0)) == []
    recording.finish()
    assert recording.tally.refused == {"speed": count}
    assert recording.tally.recorded == {"speed": 1}


def test_the_chunk_in_progress_is_all_that_a_kill_can_take(tmp_path: Path) -> None:
    writer = create(tmp_path / "drive.mcap")
    in_file: Callable[[], int] = lambda: len(list(read_drive(tmp_path / "drive.mcap")))  # noqa: E731
    for number in range(3000):
        writer.add("imu", imu(number))
        if number % 500 == 0 or writer.held == 0:
            assert in_file() == number + 1 - writer.held
    writer.flush()
    assert (writer.held, in_file()) == (0, 3000)
    writer.finish()
