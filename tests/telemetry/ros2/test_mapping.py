"""The mapping file: Autoware's is in order, others are refused with line and key."""

from __future__ import annotations

from pathlib import Path

import msgspec
import pytest

from foretwin.telemetry.mixed.merge import MergeRules
from foretwin.telemetry.ros2.mapping import (
    InRow,
    Mapping,
    MappingError,
    MapPlace,
    OutRow,
    TowardsVehicle,
    listening_only,
    parse_mapping,
    read_mapping,
)
from foretwin.telemetry.ros2.mirrored import Mirrored
from foretwin.telemetry.ros2.virtual_objects import PlacedObject

COVERS = ("foretwin.telemetry.ros2.rows",)

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
        ('"/gnss"', '"gnss"', "line 2: .*absolute ROS name"),
        ('"gnss"', '"imu"', "line 2: .*gives 'gnss'"),
        ("msg/NavSatFix", "msg/Image", "line 2: .*readable are"),
        ("nav_msgs/msg/Odometry", "sensor_msgs/msg/Imu", "line 7: .*goes out as nav_msgs"),
        ('"twin"', '"ghosts"', r"m\.toml: .*ghosts"),
        ("rmw_zenoh", "rmw_dds", r"m\.toml: .*rmw_dds"),
        ('channel = "gnss"', 'channel = "gnss"\nangle_unit = "deg"', "line 2: .*angle_unit"),
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


MAP = "[map]\nlat_deg = {lat}\nlon_deg = {lon}\n"


@pytest.mark.parametrize(
    ("added", "said"),
    [
        ("domain = 0", None), ("domain = 232", None), ("domain = -1", "domain -1: 0 to 232"),
        ("domain = 233", "domain 233: 0 to 232"),
        ("antenna_m = [1.0, 0.0, inf]", "antenna_m .*three finite numbers"),
        ('endpoint = "tcp/car"', "endpoint 'tcp/car': tcp/HOST:PORT"),
        (MAP.format(lat=89.9, lon=-180.0), None), (MAP.format(lat=-89.9, lon=180.0), None),
        (MAP.format(lat=90.0, lon=0.0), "map at 90.0, 0.0: degrees"),
        (MAP.format(lat=0.0, lon=180.1), "map at 0.0, 180.1: degrees"),
        (MAP.format(lat="nan", lon=0.0), "map at nan, 0.0: degrees"),
    ],
)  # fmt: skip
def test_where_a_head_ends(added: str, said: str | None) -> None:
    text = GOOD.replace("[[in]]", f"{added}\n[[in]]", 1)
    if said is None:
        assert parse_mapping(text, name="m.toml") != parse_mapping(GOOD, name="m.toml") or (
            added == "domain = 0"
        )
        return
    with pytest.raises(MappingError, match=f"m.toml: line 2: {said}"):
        parse_mapping(text, name="m.toml")


@pytest.mark.parametrize(
    ("added", "fits", "others"),
    [
        ('angle_unit = "deg"', {"steering", "control"}, {"gnss", "imu", "speed"}),
        ("left_positive = false", {"steering", "control"}, {"gnss", "imu", "speed"}),
        ('speed_unit = "km/h"', {"speed"}, {"gnss", "imu", "steering", "control"}),
        ('axes = "forward_right_down"', {"imu"}, {"gnss", "speed", "steering", "control"}),
    ],
)
def test_units_and_axes_are_of_some_channels(added: str, fits: set[str], others: set[str]) -> None:
    kinds = {row.channel: row.type for row in read_mapping(Path("autoware")).mapping.inwards}
    for channel in fits | others:
        text = (
            f'dialect = "ros2dds"\n[[in]]\ntopic = "/a"\ntype = "{kinds[channel]}"\n'
            f'channel = "{channel}"\n{added}\n'
        )
        if channel in fits:
            assert parse_mapping(text, name="m.toml").inwards
            continue
        key = added.split(" ", 1)[0]
        with pytest.raises(MappingError, match=rf"line 2: .*{key}.*: not of channel '{channel}'"):
            parse_mapping(text, name="m.toml")


@pytest.mark.parametrize(("unit", "known"), [("angle_unit", "rad, deg"), ("speed_unit", "m/s")])
def test_an_unknown_unit_is_answered_by_those_known(unit: str, known: str) -> None:
    text = GOOD.replace('channel = "gnss"', f'channel = "gnss"\n{unit} = "furlong"')
    with pytest.raises(MappingError, match=f"{unit} 'furlong': one of {known}"):
        parse_mapping(text, name="m.toml")


def test_what_is_left_out_of_a_mapping() -> None:
    mapping = parse_mapping(GOOD, name="m.toml")
    assert msgspec.structs.asdict(
        msgspec.structs.replace(mapping, inwards=(), outwards=(), towards_vehicle=TowardsVehicle())
    ) == {
        "dialect": "rmw_zenoh", "endpoint": None, "domain": 0, "namespace": "/", "antenna_m": None,
        "map_place": None, "inwards": (), "outwards": (), "placed": (), "lights": (),
        "mirrored": Mirrored(),
        "merged": MergeRules(), "towards_vehicle": TowardsVehicle(),
    }  # fmt: skip
    assert (mapping.towards_vehicle.enabled, mapping.towards_vehicle.max_objects) == (False, 64)
    assert (Mirrored().own_twin, Mirrored().vehicles) == (False, ())
    assert MapPlace(lat_deg=1.0, lon_deg=2.0).alt_m == 0.0
    (row,) = mapping.inwards
    assert (row.stamp, row.angle_unit, row.left_positive) == ("header", "rad", True)
    placed = PlacedObject(user_id="a", kind="car", lat_deg=1.0, lon_deg=2.0)
    assert msgspec.structs.astuple(placed)[4:] == (0.0, 0.0, 0.0, 0.0, 4.5, 1.8)


@pytest.mark.parametrize(
    "kind", [InRow, OutRow, MapPlace, TowardsVehicle, Mapping, Mirrored, PlacedObject]
)
def test_a_word_that_nobody_knows_is_refused_wherever_it_stands(kind: type) -> None:
    assert kind.__struct_config__.forbid_unknown_fields  # type: ignore[attr-defined]


def test_of_a_vehicle_that_is_listened_to_nothing_goes_out() -> None:
    mapping = parse_mapping(GOOD, name="m.toml")
    quiet = listening_only(mapping)
    assert quiet.inwards == mapping.inwards
    assert (quiet.outwards, quiet.placed, bool(quiet.mirrored)) == ((), (), False)
    assert not quiet.towards_vehicle.enabled


def test_one_stream_comes_from_one_topic() -> None:
    second = '[[in]]\ntopic = "/other"\ntype = "sensor_msgs/msg/NavSatFix"\nchannel = "gnss"\n'
    with pytest.raises(MappingError, match=r"line 11: .*stream gnss stands twice; first: /gnss"):
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


REAL = """
[[in]]
topic = "/perception/objects"
type = "autoware_perception_msgs/msg/{real}"
channel = "objects"
[map]
lat_deg = 52.5
lon_deg = 13.4
[[out]]
topic = "{topic}"
type = "autoware_perception_msgs/msg/{kind}"
source = "{source}"
"""


@pytest.mark.parametrize("kind", ["PredictedObjects", "TrackedObjects", "DetectedObjects"])
def test_a_merged_list_goes_out_as_the_real_one_comes_in(kind: str) -> None:
    row = {"topic": "/merged/objects", "kind": kind, "source": "merged_objects"}
    text = 'dialect = "ros2dds"\n' + REAL.format(real=kind, **row)
    mapping = parse_mapping(text, name="m.toml")
    assert mapping.outwards[0].towards_vehicle
    assert (mapping.vehicle_channels, mapping.run_channels) == (
        ("state",),
        ("virtual_objects", "virtual_traffic"),
    )
    other = "DetectedObjects" if kind == "TrackedObjects" else "TrackedObjects"
    with pytest.raises(MappingError, match=r"merged objects need an .* of their type"):
        parse_mapping('dialect = "ros2dds"\n' + REAL.format(real=other, **row), name="m.toml")
    nowhere = text.replace("[map]\nlat_deg = 52.5\nlon_deg = 13.4\n", "")
    with pytest.raises(MappingError, match=r"merged objects need \[map\]"):
        parse_mapping(nowhere, name="m.toml")


@pytest.mark.parametrize("source", ["merged_objects", "virtual_objects"])
def test_what_goes_out_is_not_listened_to(source: str) -> None:
    kind = "PredictedObjects"
    text = REAL.format(real=kind, kind=kind, topic="/perception/objects", source=source)
    with pytest.raises(MappingError, match="would come back as real"):
        parse_mapping('dialect = "ros2dds"\n' + text, name="m.toml")


CLOUDS = """dialect = "ros2dds"
[[in]]
topic = "/lidar/raw"
type = "sensor_msgs/msg/PointCloud2"
channel = "real_cloud"
sensor = "top"
[[out]]
topic = "/lidar/merged"
type = "sensor_msgs/msg/PointCloud2"
source = "point_cloud"
sensor = "top"
"""


def test_clouds_name_their_sensor_and_never_come_back() -> None:
    mapping = parse_mapping(CLOUDS, name="m.toml")
    assert mapping.run_channels == ("virtual_objects", "virtual_traffic", "point_cloud")
    for wrong, said in (
        (
            CLOUDS.replace('channel = "real_cloud"\nsensor = "top"', 'channel = "real_cloud"'),
            "in.*sensor",
        ),
        (CLOUDS.removesuffix('sensor = "top"\n'), "out.*sensor"),
        (CLOUDS.replace("/lidar/merged", "/lidar/raw"), "would come back as real"),
        (GOOD + 'sensor = "top"\n', "sensor"),
        (GOOD + 'layout = "autoware"\n', "layout"),
    ):
        with pytest.raises(MappingError, match=said):
            parse_mapping(wrong, name="m.toml")


def test_rules_of_the_merge_are_checked() -> None:
    with pytest.raises(MappingError, match=r"range_m 0\.0: above 0"):
        parse_mapping(GOOD + "[merged]\nrange_m = 0.0\n", name="m.toml")
