"""A recording in parts: ended by size and age, and read as one drive, whatever parts are left."""

from __future__ import annotations

from pathlib import Path

from foretwin.contracts.segments import Roll, first_left, segments_of
from foretwin.telemetry.logs import open_log
from foretwin.telemetry.logs.log import PART_MISSING
from foretwin.telemetry.processes.recording import DriveRecording
from tests.telemetry.drive_messages import INFO, START_NS
from tests.telemetry.own_recordings import read_drive
from tests.telemetry.processes.small_disk import Disk
from tests.telemetry.processes.test_recording import imu


def test_large_files_are_ended_and_read_as_one_drive(tmp_path: Path) -> None:
    path = tmp_path / "drive.mcap"
    recording = DriveRecording(path, roll=Roll(most_bytes=2000))
    recording.set_info(INFO)
    for number in range(300):
        assert recording.add("imu", imu(number)) == []
        if number % 20 == 0:
            assert recording.flush() == []
    recording.finish()
    assert len(segments_of(path)) > 3
    log = open_log(path)
    assert [message for _, message in log.samples()] == [imu(number) for number in range(300)]
    assert log.info.body_from_antenna_m == INFO.body_from_antenna_m
    assert log.info.end_stamp_ns == START_NS + 299
    assert log.skipped == {}


def test_what_is_left_of_a_recording_whose_oldest_parts_are_gone_is_one_drive(
    tmp_path: Path,
) -> None:
    path = tmp_path / "drive.mcap"
    recording = DriveRecording(path, roll=Roll(most_bytes=2000))
    recording.set_info(INFO)
    for number in range(300):
        recording.add("imu", imu(number))
        if number % 20 == 0:
            recording.flush()
    recording.finish()
    first, second, *_ = segments_of(path)
    gone = sum(1 for part in (first, second) for _ in read_drive(part))
    first.unlink()
    second.unlink()
    oldest = first_left(path)
    assert oldest.name == "drive-003.mcap"
    left = open_log(oldest)
    messages = [message for _, message in left.samples()]
    assert messages == [imu(number) for number in range(gone, 300)]
    assert left.skipped == {PART_MISSING: 2}
    alone = list(open_log(segments_of(path)[1]).samples())
    assert 0 < len(alone) < len(messages), "a later part is that part"
    for part in segments_of(path)[1:-1]:
        part.unlink()
    oldest.unlink()
    last = open_log(first_left(path))
    assert 0 < len(list(last.samples())) < len(messages)
    number = int(first_left(path).stem[-3:])
    assert last.skipped == {PART_MISSING: number - 1}


def test_an_old_part_is_ended_however_small_it_is(tmp_path: Path) -> None:
    disk = Disk(10**9)
    path = tmp_path / "drive.mcap"
    recording = DriveRecording(
        path, open_part=disk.open_part, mono_s=disk.clock, roll=Roll(most_s=10.0)
    )
    for number in range(25):
        disk.now_s = float(number)
        recording.add("imu", imu(number))
        recording.flush()
    recording.finish()
    assert len(segments_of(path)) == 3


def test_what_still_waits_when_another_one_goes_on_is_not_lost(tmp_path: Path) -> None:
    path, disk = tmp_path / "drive.mcap", Disk(10**6)
    recording = DriveRecording(path, open_part=disk.open_part)
    for number in range(5):
        recording.add("imu", imu(number), sender=7, seq=number)
    recording.flush()
    disk.room = 0
    for number in range(5, 9):
        recording.add("imu", imu(number), sender=7, seq=number)
    recording.finish(last=False)
    disk.room = 10**6
    again = DriveRecording(path, open_part=disk.open_part)
    assert (again.missing, again.tally.unwritten) == (4, {})
    for number in range(9):  # it asks for all that is kept
        again.add("imu", imu(number), sender=7, seq=number)
    again.finish()
    assert (again.missing, again.tally.recorded) == (0, {"imu": 9})
    found = [message for part in segments_of(path) for _, message in read_drive(part)]
    assert found == [imu(number) for number in range(9)]
