"""A recording survives what disks do."""

from __future__ import annotations

import errno
import io
from pathlib import Path

import pytest
from mcap.reader import NonSeekingReader

from foretwin.contracts.drive import ImuSample, SpeedSample
from foretwin.telemetry.logs.write_mcap import DriveWriter, create
from foretwin.telemetry.processes.recording import DriveRecording
from tests.telemetry.drive_messages import INFO, START_NS, every_channel
from tests.telemetry.own_recordings import read_drive

COVERS = ("foretwin.telemetry.logs.write_mcap",)


class SmallDisk(io.BytesIO):
    """A file on a disk of `room` bytes: like FileIO, it writes what still fits, then refuses."""

    def __init__(self, room: int, copy: Path) -> None:
        super().__init__()
        self._room = room
        self._copy = copy

    def write(self, data: object) -> int:
        fits = self._room - self.tell()
        if fits <= 0:
            raise OSError(errno.ENOSPC, "No space left on device")
        return super().write(bytes(data)[:fits])  # type: ignore[call-overload, no-any-return]

    def close(self) -> None:
        if not self.closed:
            self._copy.write_bytes(self.getvalue())
        super().close()


def imu(number: int) -> ImuSample:
    # Irregular numbers, so that they do not compress away.
    accel = tuple(((number * factor) % 1009) / 7.0 for factor in (613, 389, 997))
    return ImuSample(stamp_ns=START_NS + number, accel_mps2=accel, rate_radps=accel)  # type: ignore[arg-type]


@pytest.mark.parametrize("room", [40, 900, 60_000, 100_000])
def test_a_full_disk_is_told_once_and_what_was_written_stays_readable(
    tmp_path: Path, room: int
) -> None:
    path = tmp_path / "drive.mcap"
    recording = DriveRecording(
        lambda: DriveWriter(SmallDisk(room, path), info=INFO), name="drive.mcap"
    )
    events = list(recording.started())
    for number in range(6000):
        events += recording.add("imu", imu(number))
        if number % 500 == 0:
            events += recording.flush()
    events += recording.finish()
    assert [(event.level, event.source) for event in events] == [("error", "recorder")]
    assert "drive.mcap" in events[0].text
    assert "No space left on device" in events[0].text
    assert not recording.writes
    assert recording.unwritten > 0
    if room >= 60_000:
        found = [message for _, message in read_drive(path)]
        assert 1000 < len(found) < 6000
        assert found == [imu(number) for number in range(len(found))]
        with path.open("rb") as file:
            assert len(list(NonSeekingReader(file).iter_messages())) == len(found)


def test_a_folder_that_is_not_there_stops_the_recording_alone(tmp_path: Path) -> None:
    path = tmp_path / "missing" / "drive.mcap"
    recording = DriveRecording(lambda: create(path), name="drive.mcap")
    (event,) = recording.started()
    assert event.level == "error"
    assert "cannot be written" in event.text
    assert recording.add("imu", imu(0)) == []
    assert recording.set_info(INFO) == recording.flush() == recording.finish() == []
    assert recording.unwritten == 1


def test_every_channel_is_recorded(tmp_path: Path) -> None:
    path = tmp_path / "drive.mcap"
    recording = DriveRecording(lambda: create(path), name="drive.mcap")
    for channel, message in every_channel():
        assert recording.add(channel, message) == []
    assert recording.finish() == []
    assert [channel for channel, _ in read_drive(path)] == [c for c, _ in every_channel()]


def test_a_message_that_no_file_can_hold_is_counted_and_told_once(tmp_path: Path) -> None:
    recording = DriveRecording(lambda: create(tmp_path / "drive.mcap"), name="drive.mcap")
    impossible = SpeedSample(stamp_ns=-5, speed_mps=1.0)
    (event,) = recording.add("speed", impossible)
    assert event.level == "warning"
    assert recording.add("speed", impossible) == []
    assert recording.add("speed", SpeedSample(stamp_ns=5, speed_mps=1.0)) == []
    assert recording.refused == {"speed": 2}
    assert recording.counts == {"speed": 1}
    recording.finish()
