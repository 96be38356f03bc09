"""What a recorder left that is gone: counted once, and no more than its files hold."""

from __future__ import annotations

from pathlib import Path

from foretwin.contracts.drive import GnssFix
from foretwin.contracts.frames import GeoPoint
from foretwin.contracts.tally import Tally, read_tally, tally_file, write_tally
from foretwin.telemetry.processes.recording import DriveRecording
from foretwin.telemetry.processes.tally_left import tally_left


def left(folder: Path, count: int) -> Path:
    """Record so many positions and end, the tally with it."""
    path = folder / "drive.mcap"
    recording = DriveRecording(path)
    for number in range(count):
        fix = GnssFix(stamp_ns=number, position=GeoPoint(50.0, 8.0))
        recording.add("gnss", fix, sender=1, seq=number)
    recording.finish()
    return path


def test_a_recording_that_ended_is_counted_by_its_tally(tmp_path: Path) -> None:
    path = left(tmp_path, 4)
    for held in (False, True):
        assert tally_left(path, no_more_than_held=held).recorded == {"gnss": 4}


def test_what_came_into_the_file_after_the_tally_counts(tmp_path: Path) -> None:
    path = left(tmp_path, 2)
    told = tally_file(path).read_bytes()
    path.unlink()
    tally_file(path).unlink()
    left(tmp_path, 4)
    tally_file(path).write_bytes(told.replace(b'"part":2', b'"part":1'))
    assert read_tally(tally_file(path)).recorded == {"gnss": 2}  # type: ignore[union-attr]
    assert tally_left(path).recorded == {"gnss": 4}


def test_who_numbers_what_came_after_the_tally_is_read_from_the_file(tmp_path: Path) -> None:
    """One who floods the bus is numbered far ahead of the car, whose samples must still come."""
    path = tmp_path / "drive.mcap"
    recording = DriveRecording(path)

    def add(recording: DriveRecording, sender: int, numbers: range) -> None:
        for seq in numbers:
            fix = GnssFix(stamp_ns=seq, position=GeoPoint(50.0, 8.0))
            recording.add("gnss", fix, sender=sender, seq=seq)

    add(recording, 99, range(1000))
    add(recording, 7, range(300))  # the car is heard last
    recording.flush()
    told = tally_file(path).read_bytes()
    add(recording, 99, range(1000, 1400))
    recording.finish()
    tally_file(path).write_bytes(told)  # as a kill leaves it

    again = DriveRecording(path)
    assert again.tally.recorded == {"gnss": 1700}
    add(again, 7, range(300, 1500))
    again.finish()
    assert again.tally.recorded == {"gnss": 2900}
    assert again.missing == 0


def test_what_never_came_to_the_disk_is_unwritten(tmp_path: Path) -> None:
    path = left(tmp_path, 4)
    write_tally(Tally(recorded={"gnss": 6, "imu": 2}, unwritten={"gnss": 1}), tally_file(path))
    found = tally_left(path, no_more_than_held=True)
    assert found.recorded["imu"] == 0
    assert found.unwritten["imu"] == 2
    assert found.recorded["gnss"] + found.unwritten["gnss"] >= 7
