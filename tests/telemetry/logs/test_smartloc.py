"""smartLoc's texts: positions, the odometry beside them, packed and damaged ones."""

from __future__ import annotations

import gzip
from pathlib import Path
from typing import Any

import pytest

from foretwin.telemetry.logs import Log, LogError, open_log
from tests.telemetry.motion_proof import MotionProof

POINT = "point3 {} 3784144.3 901246.3 5037714.1 0 0 0 0 0 0 0 0 0\n"
ODOMETRY = "odom3 {} {} 0 0 0.001 0.002 {} 0.0025 0.0009 0.0009 4e-06 4e-06 4e-06\n"


def drive(folder: Path, odometry: bytes | str, *, name: str = "X_Input.txt") -> Path:
    (folder / "X_GT.txt").write_text("".join(POINT.format(n / 10) for n in range(10)))
    data = odometry.encode() if isinstance(odometry, str) else odometry
    (folder / name).write_bytes(data)
    return folder


def by_channel(log: Log) -> dict[str, list[Any]]:
    found: dict[str, list[Any]] = {}
    for channel, message in log.samples():
        found.setdefault(channel, []).append(message)
    return found


def test_what_cannot_be_used_is_counted(tmp_path: Path) -> None:
    text = (
        POINT.format("0")
        + "point3 0.2 x y z\n"
        + "point3 0.4 0 0 0\n"
        + "point3 0.6 nan 901246.3 5037714.1\n"
        + POINT.format("0.8") * 2
        + POINT.format("0.5")
        + POINT.format("1.0")
        + "point3 1.2\n"
    )
    (tmp_path / "dirty.txt").write_text(text)
    log = open_log(tmp_path / "dirty.txt")
    assert [one.stamp_ns for one in by_channel(log)["gnss"]] == [
        0, 500_000_000, 800_000_000, 1_000_000_000,
    ]  # fmt: skip
    assert log.skipped == {
        "unreadable row": 2,
        "position not finite": 2,
        "time doubled": 1,
    }


def test_a_number_that_was_cut_off_is_none(tmp_path: Path) -> None:
    for end in (" 0 0 0 0 0 0 0 0 0\n", ".1", "1", ".1 0"):
        line = POINT.format("0.2").removesuffix(".1 0 0 0 0 0 0 0 0 0\n")
        (tmp_path / "cut.txt").write_text(POINT.format("0") + line + end)
        log = open_log(tmp_path / "cut.txt")
        whole = end.count(" ") > 0
        assert len(by_channel(log)["gnss"]) == 1 + whole
        assert log.skipped == ({} if whole else {"unreadable row": 1})


def test_what_a_disk_left_blank_is_counted(tmp_path: Path) -> None:
    text = POINT.format("0") + POINT.format("0.2")[:-9] + "\0" * 99 + " 0 0\n" + POINT.format("0.8")
    (tmp_path / "blank.txt").write_text(text)
    log = open_log(tmp_path / "blank.txt")
    assert len(by_channel(log)["gnss"]) == 2
    assert log.skipped == {"unreadable row": 1}


@pytest.mark.parametrize("z_m", ["503771", "5137714.1"])
def test_a_position_deep_in_the_earth_or_in_space_is_none(tmp_path: Path, z_m: str) -> None:
    text = POINT.format("0") + POINT.format("0.2").replace("5037714.1", z_m)
    (tmp_path / "deep.txt").write_text(text)
    log = open_log(tmp_path / "deep.txt")
    assert len(by_channel(log)["gnss"]) == 1
    assert log.skipped == {"position off Earth": 1}


@pytest.mark.parametrize("packed", [False, True])
def test_a_folder_gives_positions_and_odometry_as_one_drive(tmp_path: Path, packed: bool) -> None:
    text = ODOMETRY.format(0.0, 5.0, 0.1) + ODOMETRY.format(0.2, 5.5, -0.3)
    text += "pseudorange3 0.2 1 2 3 4 5 6 7 8 9\n" + ODOMETRY.format(0.4, "fast", 0)
    data = gzip.compress(text.encode()) if packed else text
    log = open_log(drive(tmp_path, data, name="X_Input.txt" + ".gz" * packed))
    found = by_channel(log)

    assert log.info.sends == ("gnss", "speed", "imu")
    assert log.skipped == {"unreadable row": 1}
    assert [one.speed_mps for one in found["speed"]] == [5.0, 5.5]
    # Of the first odometry there is no acceleration yet.
    assert [one.stamp_ns for one in found["imu"]] == [200_000_000]
    assert found["imu"][0].rate_radps == (0.001, 0.002, -0.3)
    assert found["imu"][0].accel_mps2 == pytest.approx((2.5, 0.0, 9.80665))


def test_odometry_after_a_gap_tells_no_acceleration(tmp_path: Path) -> None:
    text = "".join(ODOMETRY.format(t, v, 0) for t, v in ((0, 1), (0.2, 2), (9.0, 30), (9.2, 30)))
    found = by_channel(open_log(drive(tmp_path, text)))
    assert [one.accel_mps2[0] for one in found["imu"]] == pytest.approx([5.0, 0.0])


def test_one_text_may_hold_both(tmp_path: Path) -> None:
    path = tmp_path / "both.txt"
    path.write_text(ODOMETRY.format(0, 5, 0) + POINT.format(0.1) + ODOMETRY.format(0.2, 5, 0))
    assert open_log(path).info.sends == ("gnss", "speed", "imu")


def test_odometry_alone_and_damaged_gzip_are_refused(tmp_path: Path) -> None:
    folder = drive(tmp_path, ODOMETRY.format(0, 5, 0))
    with pytest.raises(LogError, match=r"X_Input\.txt: no readable line .*: name the folder"):
        open_log(folder / "X_Input.txt")
    packed = gzip.compress(ODOMETRY.format(0, 5, 0).encode() * 500)
    drive(tmp_path, packed[:60], name="X_Input.txt.gz")
    with pytest.raises(LogError, match=r"X_Input\.txt\.gz: damaged gzip: "):
        open_log(folder)


@pytest.mark.real_data
def test_units_signs_and_times_of_potsdamer_platz(data_dir: Path) -> None:
    shown = MotionProof(open_log(data_dir / "drive-berlin-potsdamer-platz"))

    speed, rate = shown.of_speed(), shown.of_yaw_rate()
    assert speed.correlation > 0.995
    assert speed.slope == pytest.approx(1.0, abs=0.02)
    assert abs(speed.lag_s) < 0.11
    assert rate.correlation > 0.98
    assert rate.slope == pytest.approx(1.0, abs=0.05)
    assert abs(rate.lag_s) < 0.11
