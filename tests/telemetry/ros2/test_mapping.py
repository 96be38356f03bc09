"""The mapping file: Autoware's is in order, others are refused with line and key."""

from __future__ import annotations

from pathlib import Path

import pytest

from foretwin.telemetry.ros2.mapping import MappingError, parse_mapping, read_mapping

GOOD = """dialect = "rmw_zenoh"
[[in]]
topic = "/gnss"
type = "sensor_msgs/msg/NavSatFix"
channel = "gnss"

[[out]]
topic = "/foretwin/odometry"
type = "nav_msgs/msg/Odometry"
source = "twin"
"""


def test_the_mapping_for_autoware() -> None:
    mapping = read_mapping(Path("autoware")).mapping
    assert {row.channel for row in mapping.inwards} >= {
        "gnss",
        "imu",
        "speed",
        "steering",
        "control",
        "plan",
        "status",
        "objects",
        "signals",
    }
    assert not mapping.towards_vehicle.enabled
    assert not [row.topic for row in mapping.outwards if row.towards_vehicle]


@pytest.mark.parametrize(
    ("topic", "kind", "source", "towards"),
    [
        ("/foretwin/odometry", "nav_msgs/msg/Odometry", "twin", False),
        ("/localization/kinematic_state", "nav_msgs/msg/Odometry", "twin", True),
        ("/foretwin/control", "autoware_control_msgs/msg/Control", "vehicle_command", True),
        ("/clock", "rosgraph_msgs/msg/Clock", "clock", True),
        ("/foretwinned/clock", "rosgraph_msgs/msg/Clock", "clock", True),
    ],
)
def test_what_a_vehicle_might_obey_goes_towards_it(
    topic: str, kind: str, source: str, towards: bool
) -> None:
    text = f'dialect = "ros2dds"\n[[out]]\ntopic = "{topic}"\ntype = "{kind}"\nsource = "{source}"'
    assert parse_mapping(text, name="m").outwards[0].towards_vehicle is towards


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('"/gnss"', '"gnss"', "line 2, .*absolute ROS name"),
        ('"gnss"', '"imu"', "line 2, .*gives 'gnss'"),
        ("msg/NavSatFix", "msg/Image", "line 2, .*readable are"),
        ("nav_msgs/msg/Odometry", "sensor_msgs/msg/Imu", "line 7, .*goes out as nav_msgs"),
        ('"twin"', '"ghosts"', r"m\.toml: .*ghosts"),
        ("rmw_zenoh", "rmw_dds", r"m\.toml: .*rmw_dds"),
        ('channel = "gnss"', 'channel = "gnss"\nangle_unit = "deg"', "line 2, .*angle_unit"),
        ('channel = "gnss"', 'channel = "gnss"\nstamps = 3', r"m\.toml: .*stamps"),
        ('dialect = "rmw_zenoh"', 'dialect = "rmw_zenoh"\ndomain = 999', "domain 999: 0 to 232"),
        ("[[in]]", "[[in]", "not TOML"),
        ('source = "twin"', 'source = "twin"\n[towards_vehicle]\nmax_rate_hz = 0.0', "max_rate_hz"),
    ],
)
def test_errors_say_where_and_what_would_be_right(old: str, new: str, said: str) -> None:
    assert old in GOOD
    with pytest.raises(MappingError, match=said):
        parse_mapping(GOOD.replace(old, new), name="m.toml")


def test_one_stream_comes_from_one_topic() -> None:
    second = '[[in]]\ntopic = "/other"\ntype = "sensor_msgs/msg/NavSatFix"\nchannel = "gnss"\n'
    with pytest.raises(MappingError, match=r"line 11, .*stream gnss stands twice; first: /gnss"):
        parse_mapping(GOOD + second, name="m.toml")


def test_virtual_objects_towards_the_vehicle_need_a_map() -> None:
    row = (
        '[[out]]\ntopic = "/perception/objects"\nsource = "virtual_objects"\n'
        'type = "autoware_perception_msgs/msg/PredictedObjects"\n'
    )
    with pytest.raises(MappingError, match=r"need \[map\]"):
        parse_mapping(GOOD + row, name="m.toml")
    parse_mapping(GOOD + row + "[map]\nlat_deg = 52.0\nlon_deg = 13.0\n", name="m.toml")


def test_a_missing_file() -> None:
    with pytest.raises(FileNotFoundError, match="no such file"):
        read_mapping(Path("nowhere.toml"))
