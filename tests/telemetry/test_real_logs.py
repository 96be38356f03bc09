"""Every real drive is read with the right place, time, sign and unit."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from foretwin.contracts.drive import GnssFix
from foretwin.contracts.frames import LocalFrame, local_from_geo, wrap_angle
from foretwin.telemetry.logs import Log, LogError, line_of_log, open_log, read_line

DECLARATIONS = Path(__file__).parents[1] / "data" / "declarations"

pytestmark = pytest.mark.real_data


def by_channel(log: Log) -> dict[str, list[Any]]:
    found: dict[str, list[Any]] = {}
    for channel, message in log.samples():
        found.setdefault(channel, []).append(message)
    return found


def column(messages: Iterable[msgspec.Struct], field: str) -> np.ndarray:
    return np.array([getattr(message, field) for message in messages])


def courses(fixes: list[GnssFix]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return stamps, course over ground from true east and speed between fixes 0.5 s apart."""
    frame = LocalFrame(fixes[0].position)
    xy = local_from_geo(
        frame,
        np.array([fix.position.lat_deg for fix in fixes]),
        np.array([fix.position.lon_deg for fix in fixes]),
    )
    stamps = column(fixes, "stamp_ns")
    apart = max(1, round(0.5e9 / float(np.median(np.diff(stamps)))))
    way, time_s = xy[apart:] - xy[:-apart], (stamps[apart:] - stamps[:-apart]) / 1e9
    course = np.arctan2(way[:, 1], way[:, 0])
    return (stamps[apart:] + stamps[:-apart]) / 2, course, np.hypot(*way.T) / time_s


def heading_errors(found: dict[str, list[Any]], *, above_mps: float) -> np.ndarray:
    """Return measured yaw minus course over ground in degrees while driving."""
    stamps, course, speed = courses(found["gnss"])
    yaw = np.unwrap(column(found["heading"], "yaw_rad"))
    measured = np.interp(stamps, column(found["heading"], "stamp_ns"), yaw)
    return np.degrees(wrap_angle(measured - course))[speed > above_mps]


@pytest.fixture(scope="module")
def comma(data_dir: Path) -> dict[str, list[Any]]:
    return by_channel(open_log(data_dir / "drive-comma2k19-sf" / "segment40"))


@pytest.fixture(scope="module")
def dresden(data_dir: Path) -> Log:
    path = data_dir / "drive-dresden-imu" / "2014-03-26-000-Data.csv"
    return open_log(path, declaration=DECLARATIONS / "dresden.csv.toml")


@pytest.fixture(scope="module")
def boreas(data_dir: Path) -> dict[str, list[Any]]:
    path = next((data_dir / "drive-boreas-toronto").glob("*.csv"))
    return by_channel(open_log(path, declaration=DECLARATIONS / "boreas.csv.toml"))


def test_berlin_lies_in_berlin_and_loses_nothing(data_dir: Path) -> None:
    log = open_log(data_dir / "drive-berlin-gendarmenmarkt" / "Berlin_Gendarmenmarkt_GT.txt")
    fixes = by_channel(log)["gnss"]
    assert len(fixes) == 3475
    assert not log.skipped
    assert log.info.time_base == "log"
    assert log.info.body_from_antenna_m is None
    assert (log.info.start_stamp_ns, log.info.end_stamp_ns) == (0, 699_899_999_857)
    assert fixes[0].position.lat_deg == pytest.approx(52.511659, abs=1e-6)
    assert fixes[0].position.lon_deg == pytest.approx(13.396217, abs=1e-6)


def test_berlin_can_be_read_twice_and_in_part(data_dir: Path) -> None:
    log = open_log(data_dir / "drive-berlin-gendarmenmarkt" / "Berlin_Gendarmenmarkt_GT.txt")
    assert len(line_of_log(log).lat_deg) == len(line_of_log(log).lat_deg) == 3475
    assert len(line_of_log(log, start_s=10.0, end_s=20.0).lat_deg) == 51


class TestComma2k19:
    def test_channels_and_clock(self, data_dir: Path, comma: dict[str, list[Any]]) -> None:
        counts = {channel: len(messages) for channel, messages in comma.items()}
        assert counts == {
            "gnss": 1200,
            "heading": 1200,
            "imu": 6256,
            "speed": 4974,
            "steering": 4974,
        }
        info = open_log(data_dir / "drive-comma2k19-sf" / "segment40").info
        assert info.time_base == "boot"
        assert info.reference_point == "camera"
        assert info.start_stamp_ns == 46_408_547_498_000

    def test_all_channels_together_rise_in_time(self, data_dir: Path) -> None:
        log = open_log(data_dir / "drive-comma2k19-sf" / "segment40")
        stamps = [message.stamp_ns for _, message in log.samples()]  # type: ignore[attr-defined]
        assert stamps == sorted(stamps)

    def test_speed_is_metres_per_second(self, comma: dict[str, list[Any]]) -> None:
        stamps, _, speed = courses(comma["gnss"])
        measured = np.interp(
            stamps, column(comma["speed"], "stamp_ns"), column(comma["speed"], "speed_mps")
        )
        assert np.median(np.abs(measured - speed)) < 0.3

    def test_camera_looks_forward(self, comma: dict[str, list[Any]]) -> None:
        errors = heading_errors(comma, above_mps=5.0)
        assert np.median(errors) == pytest.approx(0.9, abs=0.2)
        assert np.percentile(np.abs(errors - np.median(errors)), 90) < 0.5

    def test_imu_stands_upright_and_turns_as_the_pose(self, comma: dict[str, list[Any]]) -> None:
        accel = column(comma["imu"], "accel_mps2")
        assert accel[:, 2].mean() == pytest.approx(9.7, abs=0.2)
        yaw_stamps = column(comma["heading"], "stamp_ns")
        turned = np.gradient(np.unwrap(column(comma["heading"], "yaw_rad")), yaw_stamps / 1e9)
        rate = column(comma["imu"], "rate_radps")[:, 2]
        smooth = np.convolve(rate, np.ones(21) / 21, "same")
        same = np.interp(yaw_stamps, column(comma["imu"], "stamp_ns"), smooth)
        assert np.corrcoef(np.convolve(turned, np.ones(5) / 5, "same"), same)[0, 1] > 0.9

    def test_steering_is_positive_to_the_left(self, comma: dict[str, list[Any]]) -> None:
        stamps = column(comma["imu"], "stamp_ns")
        rate = np.convolve(column(comma["imu"], "rate_radps")[:, 2], np.ones(51) / 51, "same")
        wheel = column(comma["steering"], "steering_wheel_rad")
        speed = np.interp(
            stamps, column(comma["speed"], "stamp_ns"), column(comma["speed"], "speed_mps")
        )
        expected = np.interp(stamps, column(comma["steering"], "stamp_ns"), wheel) * speed
        assert np.corrcoef(expected, rate)[0, 1] > 0.75
        assert np.degrees(np.abs(wheel)).max() == pytest.approx(4.6, abs=0.1)


class TestDresden:
    def test_repeated_fixes_are_taken_once(self, dresden: Log) -> None:
        counts = Counter(channel for channel, _ in dresden.samples())
        assert counts["imu"] == 10_799  # the last line has no end
        assert counts["gnss"] == counts["speed"] == 2158
        assert dresden.info.start_stamp_ns == 1_395_837_505_119_146_000

    def test_kilometres_per_hour_and_clockwise_course(self, dresden: Log) -> None:
        found = by_channel(dresden)
        stamps, _, speed = courses(found["gnss"])
        measured = np.interp(
            stamps, column(found["speed"], "stamp_ns"), column(found["speed"], "speed_mps")
        )
        assert np.median(np.abs(measured - speed)) < 1.0
        assert abs(np.median(heading_errors(found, above_mps=4.0))) < 2.0

    def test_imu_feels_gravity_and_braking(self, dresden: Log) -> None:
        found = by_channel(dresden)
        accel = column(found["imu"], "accel_mps2")
        assert accel[:, 2].mean() == pytest.approx(9.6, abs=0.2)
        stamps = column(found["imu"], "stamp_ns")
        speed = np.interp(
            stamps, column(found["speed"], "stamp_ns"), column(found["speed"], "speed_mps")
        )
        wide = np.ones(101) / 101
        change = np.gradient(np.convolve(speed, wide, "same"), stamps / 1e9)[200:-200]
        felt = np.convolve(accel[:, 0], wide, "same")[200:-200]
        assert np.corrcoef(change, felt)[0, 1] > 0.6


class TestBoreas:
    def test_utm_lies_in_toronto(self, boreas: dict[str, list[Any]]) -> None:
        assert len(boreas["gnss"]) == 10_790
        assert boreas["gnss"][0].position.lat_deg == pytest.approx(43.782155, abs=1e-6)
        assert boreas["gnss"][0].position.lon_deg == pytest.approx(-79.466140, abs=1e-6)

    def test_yaw_is_from_true_east_though_the_sensor_is_turned(
        self, boreas: dict[str, list[Any]]
    ) -> None:
        errors = heading_errors(boreas, above_mps=3.0)
        assert abs(np.median(errors)) < 0.1
        assert np.percentile(np.abs(errors), 90) < 1.5

    def test_yaw_rate_is_the_change_of_yaw(self, boreas: dict[str, list[Any]]) -> None:
        heading = boreas["heading"]
        yaw = np.unwrap(column(heading, "yaw_rad"))
        change = np.gradient(yaw, column(heading, "stamp_ns") / 1e9)
        assert np.corrcoef(change, column(heading, "yaw_rate_radps"))[0, 1] > 0.9


def test_hannover_holds_routes_but_no_logs(data_dir: Path) -> None:
    path = data_dir / "drives-hannover" / "2021_GoogleMaps.geojson"
    first = read_line(path)
    assert 52.3 < first.lat_deg.min() < first.lat_deg.max() < 52.5
    fourth = read_line(path.with_name(path.name + "#3"))
    assert len(first.lat_deg) != len(fourth.lat_deg)
    with pytest.raises(LogError, match="line without time; usable as --route only"):
        open_log(path)
    with pytest.raises(LogError, match=r"has no line 99; it holds 27"):
        read_line(path.with_name(path.name + "#99"))
