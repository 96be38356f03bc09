"""Frames that are kept: what was written can be read again, torn ends and full disks included."""

from __future__ import annotations

from pathlib import Path

import msgspec
import pytest

from foretwin.contracts.errors import UserError
from foretwin.viewer.copilot.frames_file import WRITE_S, FramesWriter, KeptFrames
from tests.viewer.copilot.test_now import Drive


def kept(file: Path, *times_s: float) -> FramesWriter:
    writer, drive = FramesWriter(file, 0.0), Drive()
    for time_s in times_s:
        drive.goes_on(time_s)
        writer.add(msgspec.json.encode(drive.frame()), time_s)
    return writer


def test_the_frame_at_an_instant_is_the_last_one_before_it(tmp_path: Path) -> None:
    file = tmp_path / "frames"
    kept(file, 0.5, 1.0, 1.5, 2.5, 3.0).write()
    frames = KeptFrames(file)
    assert (len(frames.frames), frames.begins_s, frames.ends_s) == (5, 0.5, 3.0)
    assert [frames.at(time_s).drive_s for time_s in (-1.0, 1.2, 2.5, 99.0)] == [0.5, 1.0, 2.5, 3.0]


def test_a_kill_takes_no_more_than_the_last_second(tmp_path: Path) -> None:
    file = tmp_path / "frames"
    times_s = [0.2 * number for number in range(1, 16)]
    kept(file, *times_s)
    found = KeptFrames(file)
    assert found.ends_s >= times_s[-1] - WRITE_S
    torn = file.read_bytes()
    kept(file, 4.0, 5.1)
    whole = file.read_bytes()
    file.write_bytes(whole[: len(torn) + 40])
    assert KeptFrames(file).ends_s == found.ends_s


def test_a_full_disk_is_counted_and_raises_nothing(tmp_path: Path) -> None:
    writer = kept(tmp_path / "no" / "frames", 0.2, 0.4)
    writer.write()
    assert writer.lost == 2


@pytest.mark.parametrize("content", [None, b"", b"nothing of ours"])
def test_what_holds_no_frames_is_said_in_a_line(tmp_path: Path, content: bytes | None) -> None:
    file = tmp_path / "frames"
    if content is not None:
        file.write_bytes(content)
    with pytest.raises(UserError, match="frame"):
        KeptFrames(file)
