"""Broken comma2k19 folders: counted where a value is bad, told where an array is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from foretwin.telemetry.logs import LogError, open_log

COVERS = ("foretwin.telemetry.logs.comma2k19",)


def save(path: Path, array: object) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("wb") as file:
        np.save(file, np.asarray(array, dtype=np.float64))


@pytest.fixture
def segment(tmp_path: Path) -> Path:
    folder = tmp_path / "segment7"
    save(folder / "global_pose/frame_times", [10.0, np.nan, 10.2, 10.1, 10.3])
    at = [3784144.3, 901246.3, 5037714.1]
    save(folder / "global_pose/frame_positions", [at, at, at, at, [np.nan] * 3])
    save(folder / "processed_log/CAN/speed/t", [10.0, 10.1])
    save(folder / "processed_log/CAN/speed/value", [[5.0], [np.inf]])
    return folder


def test_bad_values_are_counted(segment: Path) -> None:
    log = open_log(segment)
    found = [(channel, message.stamp_ns) for channel, message in log.samples()]  # type: ignore[attr-defined]
    assert found == [
        ("speed", 10_000_000_000),
        ("gnss", 10_000_000_000),
        ("gnss", 10_100_000_000),  # it came late, and is put in order
        ("gnss", 10_200_000_000),
    ]
    assert log.skipped == {
        "time before zero": 1,
        "position not finite": 1,
        "value not finite": 1,
    }
    assert log.info.sends == ("gnss", "speed")
    assert (log.info.start_stamp_ns, log.info.end_stamp_ns) == (10_000_000_000, 10_300_000_000)


def test_arrays_that_do_not_fit_are_told(segment: Path) -> None:
    save(segment / "processed_log/CAN/speed/t", [10.0])
    with pytest.raises(LogError, match=r"CAN/speed/value: 2 values for the 1 times"):
        open_log(segment)
    (segment / "processed_log/CAN/speed/t").write_bytes(b"no array")
    with pytest.raises(LogError, match=r"CAN/speed/t: no NumPy array of 1 column"):
        open_log(segment)


def test_a_segment_without_positions_is_no_drive(segment: Path) -> None:
    (segment / "global_pose/frame_positions").unlink()
    with pytest.raises(LogError, match="a drive needs positions"):
        open_log(segment)
