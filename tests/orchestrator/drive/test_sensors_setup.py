"""A drive's virtual sensors: read before it begins, and a process where there are any."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from foretwin.contracts.access import may_say
from foretwin.contracts.errors import UserError
from foretwin.contracts.keys import CHANNELS
from foretwin.contracts.setup import SensorSees, SensorsSetup
from foretwin.orchestrator.config_file import load_config
from foretwin.orchestrator.drive.processes import PROCESSES, expected_ids, member, row_of
from foretwin.orchestrator.drive.sensors_setup import (
    SENSORS,
    TOLD_WORLDS,
    check_measured,
    mounts,
    read_sensor,
)
from foretwin.orchestrator.sensor_config import SensorConfig
from foretwin.sim_worker.sensors.sensor_file import load_sensor, sensor_of
from foretwin.telemetry.ros2.mapping import MappingError, MappingFile, parse_mapping
from tests.orchestrator.trip import town_plan

COVERS = ("foretwin.orchestrator.sensor_config",)


def test_a_drive_without_sensors_has_no_process_of_them(tmp_path: Path) -> None:
    plan = town_plan(tmp_path)
    assert SENSORS not in expected_ids(plan)
    with_one = replace(plan, sensors=(read_sensor(SensorConfig(file="os1_64", sees="users")),))
    assert SENSORS in expected_ids(with_one)

    (row,) = (row for row in PROCESSES if row.name == SENSORS)
    setup = row.setup(with_one, SENSORS)
    assert isinstance(setup, SensorsSetup)
    (sensor,) = setup.sensors
    assert sensor_of(sensor.text, sensor.name) == load_sensor("os1_64")
    assert (sensor.sees, setup.worlds_dir) == ("users", str(plan.worlds_dir))
    assert may_say(member(with_one, SENSORS), CHANNELS["point_cloud"])
    assert SENSORS in TOLD_WORLDS
    assert row_of(row, town_plan(tmp_path / "x", speed=None)).when_dead == "report"


def test_settings_name_sensors(tmp_path: Path) -> None:
    file = tmp_path / "drive.toml"
    file.write_text('[[sensors]]\nfile = "vlp_16"\n\n[[sensors]]\nfile = "x"\nsees = "users"\n')
    config = load_config(file, {})

    assert config.sensors == (SensorConfig(file="vlp_16"), SensorConfig(file="x", sees="users"))
    with pytest.raises(UserError, match="no bundled sensor of that name"):
        read_sensor(config.sensors[1])


TOPIC = """dialect = "ros2dds"
[[{way}]]
topic = "/x/points"
type = "sensor_msgs/msg/PointCloud2"
{kind}
sensor = "vlp_16"
"""


@pytest.mark.parametrize(
    ("way", "sees", "right"),
    [
        ("out", ("world",), True),
        ("out", ("world", "users"), False),
        ("out", (), False),
        ("in", ("world",), False),
        ("in", ("world", "real"), True),
    ],
)
def test_a_mapping_passes_clouds_of_one_sensor(
    way: str, sees: tuple[SensorSees, ...], right: bool
) -> None:
    kind = 'source = "point_cloud"' if way == "out" else 'channel = "real_cloud"'
    text = TOPIC.format(way=way, kind=kind)
    ros2 = MappingFile("m.toml", text, parse_mapping(text, name="m.toml"))
    sensors = tuple(read_sensor(SensorConfig(file="vlp_16", sees=one)) for one in sees)
    check_measured(sensors, None)
    if right:
        check_measured(sensors, ros2)
        assert dict(mounts(sensors)) == {"vlp_16": load_sensor("vlp_16").mount}
        return
    with pytest.raises(MappingError, match=r"m.toml: topic /x/points: sensor 'vlp_16': . "):
        check_measured(sensors, ros2)


def test_only_a_lidar_has_real_ones_to_be_put_into() -> None:
    with pytest.raises(UserError, match="of kind lidar, and this is of kind radar"):
        read_sensor(SensorConfig(file="long_range_radar", sees="real"))


def test_a_file_that_is_no_sensor_is_refused_before_the_drive(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text('name = "x"\nsource = "y"\n')
    with pytest.raises(UserError, match="0 of lidar, radar, camera, gnss, imu"):
        read_sensor(SensorConfig(file=str(file)))


def test_a_mapping_passes_lists_of_radars_alone() -> None:
    text = TOPIC.format(way="out", kind='source = "radar_list"\nframe = "f"')
    text = text.replace("sensor_msgs/msg/PointCloud2", "radar_msgs/msg/RadarScan")
    radar = read_sensor(SensorConfig(file="long_range_radar"))
    ros2 = MappingFile("m.toml", text, parse_mapping(text, name="m.toml"))
    with pytest.raises(MappingError, match=r"sensor 'vlp_16': 0 .* that are a radar.*long_range"):
        check_measured((read_sensor(SensorConfig(file="vlp_16")), radar), ros2)
    right = text.replace("vlp_16", "long_range_radar")
    check_measured((radar,), MappingFile("m.toml", right, parse_mapping(right, name="m.toml")))


def test_a_camera_where_nothing_can_be_drawn_ends_before_the_drive(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("__EGL_VENDOR_LIBRARY_FILENAMES", "/nowhere.json")
    with pytest.raises(UserError, match="cameras need EGL") as raised:
        read_sensor(SensorConfig(file="vga_camera"))
    assert "\n" not in str(raised.value)
