"""Recordings are copied with another layout, also when they were cut off."""

from __future__ import annotations

from pathlib import Path

import pytest
from rerun.chunk import RrdReader

from foretwin.contracts.layout import read_layout
from foretwin.viewer.blueprint import drive_blueprint
from foretwin.viewer.monitor import Monitor
from foretwin.viewer.recordings import copy_with_blueprint, is_complete
from foretwin.viewer.sinks import FileStream
from tests.viewer import scene
from tests.viewer.readback import Recorded


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    monitor = Monitor(
        drive_frame=scene.DRIVE_FRAME,
        find_start=lambda _first: scene.START_NS,
        title="t",
        load_world=lambda _id: scene.junction(),
    )
    path = tmp_path / "drive.rrd"
    file = FileStream(path, recording_id="drive", title="t", blueprint=drive_blueprint())
    for channel, message in scene.drive(duration_s=2.0):
        file.write(monitor.handle(channel, message))
        file.flush()
    file.close()
    return path


def test_a_copy_holds_the_same_rows_and_one_layout(recording: Path, tmp_path: Path) -> None:
    copy = tmp_path / "copy.rrd"
    copy_with_blueprint(recording, copy, drive_blueprint(read_layout("gap")))
    assert is_complete(copy)
    assert Recorded(copy).paths == Recorded(recording).paths
    assert len(Recorded(copy).times_s("/world/ego/real")) == 20
    assert len(RrdReader(copy).blueprints()) == 1


def test_a_recording_cut_off_within_a_message_keeps_the_rest(
    recording: Path, tmp_path: Path
) -> None:
    whole = recording.read_bytes()
    recording.write_bytes(whole[: len(whole) // 2])
    assert not is_complete(recording)
    copy = tmp_path / "copy.rrd"
    copy_with_blueprint(recording, copy, drive_blueprint())
    assert is_complete(copy)
    assert 1 <= len(Recorded(copy).times_s("/world/ego/real")) < 20


def test_other_bytes_are_no_recording(tmp_path: Path) -> None:
    text = tmp_path / "text.rrd"
    text.write_text("no recording at all, but long enough to hold a header")
    with pytest.raises(ValueError, match=r"text\.rrd is no Rerun recording"):
        copy_with_blueprint(text, tmp_path / "copy.rrd", drive_blueprint())
