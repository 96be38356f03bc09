"""GnssLogger's texts of three generations: columns by name, one clock, a declared mounting."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from foretwin.telemetry.logs import Log, LogError, open_log
from foretwin.telemetry.logs.clock_between import clock_between
from foretwin.telemetry.logs.gnss_logger import MOUNTING_UNKNOWN
from foretwin.telemetry.logs.log import LAST_LINE_OPEN, UNREADABLE_ROW
from tests.telemetry.motion_proof import MotionProof
from tests.telemetry.public_drives import public_drive

V1 = "# Fix,Provider,Latitude,Longitude,Altitude,Speed,Accuracy,(UTC)TimeInMs\n"
V2 = (
    "# Fix,Provider,LatitudeDegrees,LongitudeDegrees,AltitudeMeters,SpeedMps,AccuracyMeters,"
    "BearingDegrees,UnixTimeMillis,SpeedAccuracyMps,BearingAccuracyDegrees,elapsedRealtimeNanos\n"
)
NOON_MS = 1_772_366_400_000
BOOT_NS = 16_000_000_000_000


def fix(second: int, *, provider: str = "GPS", bearing: str = "90.0", speed: str = "10.0") -> str:
    boot_ns = BOOT_NS + second * 10**9
    return (
        f"Fix,{provider},52.51{second},13.39,79.5,{speed},3.0192,{bearing},"
        f"{NOON_MS + 1000 * second},0.2,,{boot_ns}\n"
    )


def sensor(kind: str, tenth: int, xyz: str, bias: str = "") -> str:
    # The phone's clock is 400 ms off.
    return f"{kind},{NOON_MS + 400 + 100 * tenth},{BOOT_NS + tenth * 10**8},{xyz}{bias}\n"


def opened(tmp_path: Path, *lines: str, mounting: str = "") -> tuple[Log, dict[str, list[Any]]]:
    path = tmp_path / "gnss_log.txt"
    path.write_text("".join(lines))
    if mounting:
        path.with_name("gnss_log.txt.toml").write_text(mounting)
    log = open_log(path)
    found: dict[str, list[Any]] = {}
    for channel, message in log.samples():
        found.setdefault(channel, []).append(message)
    return log, found


def test_fixes_of_the_first_version(tmp_path: Path) -> None:
    row = f"Fix,gps,52.51,13.39,-33.0,10.5,3.0192,{NOON_MS}\n"
    log, found = opened(tmp_path, "# \n# Header Description:\n", V1, row)

    position = found["gnss"][0].position
    assert (position.lat_deg, position.lon_deg, position.alt_m) == (52.51, 13.39, -33.0)
    assert found["gnss"][0].stamp_ns == NOON_MS * 1_000_000
    assert found["gnss"][0].std_m == pytest.approx(2.0)
    assert found["speed"][0].speed_mps == 10.5
    assert log.info.sends == ("gnss", "speed")
    assert (log.info.time_base, log.info.reference_point) == ("utc", "phone")


def test_the_speed_is_not_its_accuracy_and_bearings_are_clockwise(tmp_path: Path) -> None:
    _, found = opened(tmp_path, V2, fix(0), fix(1, bearing="180.0"), fix(2, speed="1.0"))
    assert [one.speed_mps for one in found["speed"]] == [10.0, 10.0, 1.0]
    assert [one.yaw_rad for one in found["heading"]] == pytest.approx([0.0, -math.pi / 2])


def test_a_fix_without_accuracy_takes_that_of_no_other(tmp_path: Path) -> None:
    unknown = fix(1).replace("3.0192", "")
    _, found = opened(tmp_path, V2, fix(0), unknown, fix(2).replace("3.0192", "0.0"), fix(3))
    assert [one.std_m for one in found["gnss"]] == [
        pytest.approx(2.0), None, None, pytest.approx(2.0),
    ]  # fmt: skip


def test_a_last_line_without_its_end_is_left_out_and_said(tmp_path: Path) -> None:
    """Of a time in 2026 its first digits are one in 1970, of a rate of 0.35 rad/s 0.3."""
    lines = (V2, fix(0), fix(1))
    log, found = opened(tmp_path, *lines, fix(2).partition("000000,0.2")[0][:-4])
    assert len(found["gnss"]) == 2
    assert log.skipped == {LAST_LINE_OPEN: 1}
    assert log.info.start_stamp_ns == NOON_MS * 1_000_000
    held = (*lines, sensor("Accel", 0, "0,0,9.8"), sensor("Gyro", 0, "0,0,0.1"))
    log, found = opened(
        tmp_path, *held, sensor("Gyro", 1, "0,0,0.35")[:-2], mounting='forward = "y"\nup = "z"\n'
    )
    assert [one.rate_radps[2] for one in found["imu"]] == [0.1]
    assert log.skipped == {LAST_LINE_OPEN: 1}


def test_damage_among_satellites_is_said_as_well(tmp_path: Path) -> None:
    """Most lines are of satellites: blanked or cut off there, a fix may have gone too."""
    row = f"Status,{NOON_MS},61,0,1,8,1575420030,32.6,278.8,16.5,1,1,1,27.6\n"
    blanked = row[:20] + "\0" * 200 + row[30:]
    log, found = opened(tmp_path, V2, fix(0), blanked, fix(1), row[:-9])
    assert len(found["gnss"]) == 2
    assert log.skipped == {UNREADABLE_ROW: 1, LAST_LINE_OPEN: 1}


def test_gps_is_taken_else_the_fused_provider_never_the_network(tmp_path: Path) -> None:
    lines = [fix(0, provider="NLP"), fix(0, provider="FLP"), fix(1, provider="FLP")]
    _, found = opened(tmp_path, V2, *lines)
    assert len(found["gnss"]) == 2
    _, found = opened(tmp_path, V2, *lines, fix(2))
    assert [one.stamp_ns for one in found["gnss"]] == [(NOON_MS + 2000) * 1_000_000]
    with pytest.raises(LogError, match=r"no Fix row of the provider GPS or FLP; .* nlp"):
        opened(tmp_path, V2, lines[0])


def test_a_phone_whose_mounting_is_unknown_gives_no_imu_and_says_so(tmp_path: Path) -> None:
    log, found = opened(tmp_path, V2, fix(0), sensor("UncalGyro", 0, "0.1,0.2,0.3"))
    assert "imu" not in found
    assert log.skipped == {MOUNTING_UNKNOWN: 1}


def test_a_declared_mounting_turns_the_phones_axes_into_the_cars(tmp_path: Path) -> None:
    """Upright in a holder, screen to the driver: y is up, its back looks forwards."""
    log, found = opened(
        tmp_path, V2, sensor("UncalAccel", 0, "0.5,9.8,-2.0", ",0.1,0.0,0.0"),
        sensor("UncalGyro", 1, "0.01,0.3,0.02", ",0.0,0.1,0.0"),
        sensor("UncalGyro", 9, "0.01,0.3,0.02"), fix(1), mounting='forward = "-z"\nup = "y"\n',
    )  # fmt: skip
    assert len(found["imu"]) == 1  # of the later one the accelerometer was silent for 0.9 s
    assert found["imu"][0].accel_mps2 == pytest.approx((2.0, -0.4, 9.8))
    assert found["imu"][0].rate_radps == pytest.approx((-0.02, -0.01, 0.2))
    # By the fix's two clocks, not by the phone's UTC, which is 400 ms off.
    assert found["imu"][0].stamp_ns == (NOON_MS + 100) * 1_000_000
    assert log.info.sends == ("gnss", "speed", "heading", "imu")


def test_what_is_damaged_is_counted_and_what_is_wrong_told_in_a_line(tmp_path: Path) -> None:
    log, found = opened(
        tmp_path, V2, fix(0), fix(1).replace("79.5", "-29co"), "Fix,GPS,52.5\n", "Gyro,1,2,3\n",
        f"Gyro,{10**30},1,1,2,3\n", fix(4),
    )  # fmt: skip
    assert len(found["gnss"]) == 2
    assert log.skipped["unreadable row"] == 4
    with pytest.raises(LogError, match=r"forward 'x' and up '-x' are one axis"):
        opened(tmp_path, V2, fix(0), mounting='forward = "x"\nup = "-x"\n')
    with pytest.raises(LogError, match=r"gnss_log\.txt\.toml: .*up"):
        opened(tmp_path, V2, fix(0), mounting='forward = "x"\nup = "w"\n')


def test_a_sensor_of_which_no_row_can_be_read_is_none(tmp_path: Path) -> None:
    log, found = opened(
        tmp_path, V2, fix(0), sensor("Accel", 0, "?,?,?"), sensor("Gyro", 0, "0,0,0.1"),
        mounting='forward = "y"\nup = "z"\n',
    )  # fmt: skip
    assert "imu" not in found
    assert log.skipped[UNREADABLE_ROW] == 1


def test_real_logs_of_phones_that_stand(tmp_path: Path) -> None:
    """Nobody drove: place, gravity and the two clocks are shown, not the signs of driving."""
    path = public_drive("gnsslogger-phones/gnss_log_2026_02_25_23_25_37.txt")
    copy = tmp_path / path.name
    copy.write_bytes(path.read_bytes()[:1_200_000])
    copy.with_name(copy.name + ".toml").write_text('forward = "y"\nup = "z"\n')
    log = open_log(copy)
    found: dict[str, list[Any]] = {}
    for channel, message in log.samples():
        found.setdefault(channel, []).append(message)
    force = np.linalg.norm([one.accel_mps2 for one in found["imu"]], axis=1)
    assert np.median(force) == pytest.approx(9.8, abs=0.2)
    assert max(one.speed_mps for one in found["speed"]) < 2.0
    assert abs(found["imu"][0].stamp_ns - found["gnss"][0].stamp_ns) < 5 * 10**9

    pixel = open_log(public_drive("gnsslogger-phones/Pixel4_GnssLog.txt"))
    list(pixel.samples())
    assert pixel.skipped["unreadable row"] == 1  # its altitude -29co.199999


def test_a_real_drive_with_a_telephone() -> None:
    """139 fixes in a car; the NMEA that the telephone wrote beside has the same clock."""
    drive = "gnsslogger-drive/gnss_log_2024_04_13_19_53_33"
    log = open_log(public_drive(f"{drive}.txt"))
    shown = MotionProof(log)
    speed, heading = shown.of_speed(), shown.of_heading()
    assert (len(shown.found["gnss"]), len(shown.found["heading"]), log.skipped) == (139, 110, {})
    assert speed.correlation > 0.99
    assert speed.slope == pytest.approx(1.0, abs=0.03)
    assert 0.0 <= speed.lag_s < 0.6
    assert heading.correlation > 0.9
    assert heading.slope == pytest.approx(1.0, abs=0.05)
    assert abs(shown.heading_offset_deg()) < 0.5
    between = clock_between(log, open_log(public_drive(f"{drive}.nmea")))
    assert abs(between.offset_s) < 3.0 * between.std_s < 0.1
