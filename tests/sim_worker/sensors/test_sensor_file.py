"""Sensor files: those that come along are the sensors that they are called after."""

from __future__ import annotations

from pathlib import Path

import pytest

from foretwin.contracts.errors import MissingFileError, UserError
from foretwin.sim_worker.sensors.kinds import Lidar, Radar
from foretwin.sim_worker.sensors.sensor_file import (
    DEFAULT_FILE,
    bundled_sensors,
    load_sensor,
    sensor_of,
    sensor_text,
)

COVERS = ("foretwin.sim_worker.sensors.kinds",)


@pytest.mark.parametrize(
    ("name", "rings", "lowest_deg", "highest_deg", "points_per_s"),
    [
        ("vlp_16", 16, -15.0, 15.0, 300_000),
        ("hdl_32e", 32, -30.67, 10.67, 700_000),
        ("vlp_32c", 32, -25.0, 15.0, 600_000),
        ("os1_64", 64, -16.6, 16.6, 655_360),
    ],
)
def test_a_bundled_sensor_is_what_its_data_sheet_says(
    name: str, rings: int, lowest_deg: float, highest_deg: float, points_per_s: float
) -> None:
    sensor = load_sensor(name)
    lidar = sensor.measures(Lidar)

    assert (sensor.name, len(lidar.elevation_deg)) == (name, rings)
    assert (lidar.elevation_deg[0], lidar.elevation_deg[-1]) == (lowest_deg, highest_deg)
    assert rings * lidar.azimuths * lidar.rate_hz == pytest.approx(points_per_s, rel=0.05)
    assert len(sensor.source) > 40


def test_the_bundled_ones_are_known_by_name() -> None:
    lidars, radars = ("hdl_32e", "os1_64", "vlp_16", "vlp_32c"), ("long_range_radar",)
    assert set(bundled_sensors()) == {
        *lidars,
        *radars,
        "short_range_radar",
        "vga_camera",
        "gnss_standard",
        "imu_mems",
    }
    assert list(bundled_sensors()) == sorted(bundled_sensors())
    assert load_sensor(DEFAULT_FILE) == load_sensor("vlp_16")


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("[-15, -13,", "[-13, -15,", "line 9: lidar.elevation_deg: from the lowest ring"),
        ("[-15, -13,", "[-95, -13,", "line 9: lidar.elevation_deg: one or more angles"),
        ("azimuths = 1808", "azimuths = 0", "line 10: lidar.azimuths 0: 1 to 262144"),
        ("azimuths = 1808", "azimuths = 20000", "lidar.azimuths 20000: at most 262144 rays"),
        ("dropout = 0.005", "dropout = 1.5", "lidar.dropout 1.5: 0 to 1"),
        ("range_std_m = 0.03", "range_std_m = -1.0", "lidar.range_std_m -1: 0 to 10"),
        (
            "min_range_m = 0.5",
            "min_range_m = 200.0",
            "lidar.min_range_m 200: below lidar.max_range_m",
        ),
        ("up_m = 1.9", "up_m = nan", "mount.up_m nan: a finite number"),
        ("up_m = 1.9", "up = 1.9", "up"),
        ('"clockwise"', '"left"', "lidar.turns"),
    ],
)
def test_what_is_wrong_is_told_with_its_line(old: str, new: str, said: str) -> None:
    text, _ = sensor_text("vlp_16")
    assert old in text

    with pytest.raises(UserError) as raised:
        sensor_of(text.replace(old, new, 1), "mine.toml")
    assert said in str(raised.value)
    assert "\n" not in str(raised.value)


def test_a_missing_file_is_told_with_the_names_that_there_are(tmp_path: Path) -> None:
    with pytest.raises(MissingFileError, match=r"nowhere.*" + ", ".join(bundled_sensors())):
        load_sensor(tmp_path / "nowhere.toml")


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("seen_share = 0.9", "seen_share = 1.0", "radar.seen_share 1: 0.01 to 0.9999"),
        ("rate_hz = 15.0", "rate_hz = 0.0", "radar.rate_hz 0: 0.1 to 100"),
        (
            "min_range_m = 1.0",
            "min_range_m = 300.0",
            "radar.min_range_m 300: below radar",
        ),
        ("[radar]", "delay_s = -1.0\n[radar]", "delay_s"),
        ("[mount]", "delay_s = 11.0\n[mount]", "delay_s 11: 0 to 10"),
        ("[radar]", "[lidar]", "lidar"),
        ("[radar]", "[sonar]", "sonar"),
        ("seen_share = 0.9", "seen_share = inf", "radar.seen_share inf: a finite number"),
    ],
)
def test_what_is_wrong_with_a_radar_is_told(old: str, new: str, said: str) -> None:
    text, _ = sensor_text("long_range_radar")
    assert old in text

    with pytest.raises(UserError) as raised:
        sensor_of(text.replace(old, new, 1), "mine.toml")
    assert said in str(raised.value)
    assert "\n" not in str(raised.value)


def test_a_sensor_is_of_one_kind() -> None:
    radar, lidar = (sensor_text(name)[0] for name in ("long_range_radar", "vlp_16"))
    for text, count in (
        (radar + lidar[lidar.index("[lidar]") :], 2),
        (radar[: radar.index("[radar]")], 0),
    ):
        with pytest.raises(UserError, match=f"mine.toml.*{count} of lidar, radar, camera"):
            sensor_of(text, "mine.toml")
    with pytest.raises(UserError, match="vlp_16: of kind lidar, and radar is needed"):
        load_sensor("vlp_16").measures(Radar)


def test_what_all_kinds_share_is_read_once() -> None:
    text, _ = sensor_text("short_range_radar")
    sensor = sensor_of("delay_s = 0.05\nseed = 7\n" + text, "mine.toml")
    assert (sensor.delay_s, sensor.seed, sensor.kind.rate_hz) == (0.05, 7, 20.0)
    assert sensor.kind_name == "radar"


@pytest.mark.parametrize(
    ("name", "reach_m", "rate_hz", "view_deg"),
    [("long_range_radar", (250, 300), (5, 20), (18, 30)),
     ("short_range_radar", (30, 100), (20, 50), (120, 170))],
)  # fmt: skip
def test_a_bundled_radar_is_within_the_spans_of_its_source(
    name: str, reach_m: tuple[int, int], rate_hz: tuple[int, int], view_deg: tuple[int, int]
) -> None:
    radar = load_sensor(name).measures(Radar)
    for value, (low, high) in (
        (radar.seen_to_m, reach_m), (radar.rate_hz, rate_hz), (radar.field_of_view_deg, view_deg),
        (radar.range_rate_std_mps, (0.03, 0.12)),
    ):  # fmt: skip
        assert low <= value <= high
