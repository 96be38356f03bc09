"""KITTI's oxts: a folder or a zip of rows, with times of no zone."""

from __future__ import annotations

import math
import shutil
import zipfile
from pathlib import Path
from typing import Any

import pytest

from foretwin.telemetry.logs import Log, LogError, open_log
from tests.telemetry.motion_proof import MotionProof
from tests.telemetry.public_drives import public_drive


def row(number: int, *, speed: float = 10.0) -> str:
    place = [49.0 + 1e-6 * number, 8.4, 116.0, 0.01, 0.02, math.pi / 2, 10.0, 0.0, speed, 0.0, 0.0]
    motion = [0.5, -0.1, 9.8, 0.5, -0.1, 9.8, 0.001, 0.002, 0.03, 0.001, 0.002, 0.031]
    return " ".join(map(str, [*place, *motion, 0.04, 0.015, 4, 9, 6, 6, 0]))


def drive(folder: Path, *, rows: int = 5, times: int = 5) -> Path:
    data = folder / "2011_09_26_drive_0002_sync" / "oxts" / "data"
    data.mkdir(parents=True)
    for number in range(rows):
        (data / f"{number:010d}.txt").write_text(row(number) + "\n")
    text = "".join(f"2011-09-26 13:02:44.{n}35092332\n" for n in range(times))
    (data.parent / "timestamps.txt").write_text(text)
    return data.parents[1]


def zipped(folder: Path) -> Path:
    return Path(shutil.make_archive(str(folder), "zip", folder.parent, folder.name))


def by_channel(log: Log) -> dict[str, list[Any]]:
    found: dict[str, list[Any]] = {}
    for channel, message in log.samples():
        found.setdefault(channel, []).append(message)
    return found


@pytest.mark.parametrize("packed", [False, True])
@pytest.mark.parametrize("inner", [False, True])
def test_channels_units_and_times(tmp_path: Path, packed: bool, inner: bool) -> None:
    folder = drive(tmp_path)
    folder = folder / "oxts" if inner else folder
    log = open_log(zipped(folder) if packed else folder)
    found = by_channel(log)

    assert {channel: len(messages) for channel, messages in found.items()} == dict.fromkeys(
        ("gnss", "heading", "speed", "imu"), 5
    )
    assert [one.stamp_ns for one in found["gnss"]] == [n * 100_000_000 for n in range(5)]
    assert found["gnss"][1].position.lat_deg == pytest.approx(49.000001)
    assert found["gnss"][0].std_m == 0.04
    assert (found["heading"][0].yaw_rad, found["heading"][0].yaw_rate_radps) == (math.pi / 2, 0.031)
    assert found["imu"][0].accel_mps2 == (0.5, -0.1, 9.8)
    assert found["imu"][0].rate_radps == (0.001, 0.002, 0.03)
    assert (log.info.time_base, log.info.reference_point) == ("log", "OXTS RT3003")


def test_a_fraction_of_a_second_may_have_fewer_digits(tmp_path: Path) -> None:
    folder = drive(tmp_path, rows=2)
    times = "2011-09-26 13:02:44.9\n2011-09-26 13:02:45.25\n"
    (folder / "oxts" / "timestamps.txt").write_text(times)
    assert [one.stamp_ns for one in by_channel(open_log(folder))["gnss"]] == [0, 350_000_000]


def test_what_is_missing_or_damaged_is_counted(tmp_path: Path) -> None:
    folder = drive(tmp_path, rows=7, times=6)
    data = folder / "oxts" / "data"
    (data / "0000000001.txt").unlink()
    (data / "0000000002.txt").write_text("49.0 8.4")
    (data / "0000000003.txt").write_text(row(3).replace("8.4", "x", 1))
    times = folder / "oxts" / "timestamps.txt"
    times.write_text(times.read_text().replace("44.435", "ab.435"))
    log = open_log(folder)

    assert len(by_channel(log)["gnss"]) == 2
    assert log.skipped == {"unreadable row": 3, "time without its row": 1}


def test_what_cannot_be_read_is_told_in_a_line(tmp_path: Path) -> None:
    folder = drive(tmp_path)
    (folder / "oxts" / "timestamps.txt").write_text("yesterday\n")
    with pytest.raises(LogError, match=r"drive_0002_sync: no readable time in oxts/timestamps"):
        open_log(folder)
    with zipfile.ZipFile(tmp_path / "other.zip", "w") as packed:
        packed.writestr("readme.txt", "nothing")
    with pytest.raises(LogError, match=r"other\.zip: a zip without a folder oxts"):
        open_log(tmp_path / "other.zip")


def test_real_rows_of_karlsruhe(tmp_path: Path) -> None:
    folder = public_drive("kitti-oxts")
    shown = MotionProof(open_log(folder))
    for proof in (shown.of_speed(), shown.of_yaw_rate(), shown.of_acceleration()):
        assert proof.correlation > 0.98
        assert proof.slope == pytest.approx(1.0, abs=0.07)
        assert abs(proof.lag_s) < 0.11
    assert abs(shown.heading_offset_deg()) < 0.3

    damaged = bytearray(zipped(shutil.copytree(folder, tmp_path / "copy")).read_bytes())
    damaged[5000:5040] = bytes(40)
    (tmp_path / "damaged.zip").write_bytes(damaged)
    with pytest.raises(LogError, match=r"damaged\.zip: damaged zip: "):
        open_log(tmp_path / "damaged.zip")
