"""Bags of ROS 1 and ROS 2 that other programs wrote, and MCAP whose topics change their type."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore

from foretwin.contracts import drive
from foretwin.contracts.frames import GeoPoint, LocalFrame
from foretwin.telemetry.logs import LogError, open_log
from foretwin.telemetry.ros_messages.motion import odometry_from_state
from foretwin.telemetry.ros_messages.objects import predicted_from_users
from foretwin.telemetry.ros_messages.parts import (
    CONTROL_MODE_REPORT,
    GEAR_REPORT,
    NAV_SAT_FIX,
    ODOMETRY,
    PREDICTED_OBJECTS,
    TF,
    TRAFFIC_LIGHTS,
    TWIST_STAMPED,
    VELOCITY_REPORT,
    header_from,
    ros_type,
    time_from,
    twist_from,
    typestore,
)
from tests.telemetry import drive_messages
from tests.telemetry.autoware_messages import ros_from_signals, transform_message
from tests.telemetry.test_foreign_mcap import START_NS, ForeignFile, fix, velocity

COVERS = (
    "foretwin.telemetry.logs.ros_bag",
    "foretwin.telemetry.logs.ros_log",
    "foretwin.telemetry.logs.write_bag",
    "foretwin.telemetry.logs.map_origin",
)

MS = 10**6


def autoware_drive() -> Iterator[tuple[str, str, Any, int]]:
    """Yield topic, type, message and log time of 1 s of an Autoware car that is taken over."""
    lever = transform_message(
        START_NS, parent="base_link", child="antenna", place_m=(1.5, 0.0, 1.25), yaw_rad=0.0
    )
    yield "/tf_static", TF, lever, START_NS
    for tick in range(10):
        at = START_NS + tick * 100 * MS
        yield "/sensing/gnss/fix", NAV_SAT_FIX, fix(at, 52.5 + 1e-5 * tick), at
        yield "/vehicle/status/velocity_status", VELOCITY_REPORT, velocity(at + MS, 8.0), at + MS
        mode = ros_type(CONTROL_MODE_REPORT)(
            stamp=time_from(at + 2 * MS), mode=1 if tick < 5 else 4
        )
        yield "/vehicle/status/control_mode", CONTROL_MODE_REPORT, mode, at + 2 * MS
        gear = ros_type(GEAR_REPORT)(stamp=time_from(at + 2 * MS), report=2)
        yield "/vehicle/status/gear_status", GEAR_REPORT, gear, at + 2 * MS
        lights = ros_from_signals(
            at + 3 * MS, [drive.SignalState(stamp_ns=at + 3 * MS, group_id="42", colour="red")]
        )
        yield "/perception/traffic_lights", TRAFFIC_LIGHTS, lights, at + 3 * MS


def write_bag(path: Path, plugin: StoragePlugin, messages: Any) -> Path:
    with Writer2(path, version=8, storage_plugin=plugin) as writer:
        connections: dict[tuple[str, str], Any] = {}
        for topic, kind, message, at in messages:
            if (topic, kind) not in connections:
                connections[topic, kind] = writer.add_connection(topic, kind, typestore=typestore())
            writer.write(connections[topic, kind], at, typestore().serialize_cdr(message, kind))
    return path


@pytest.mark.parametrize("plugin", [StoragePlugin.SQLITE3, StoragePlugin.MCAP])
@pytest.mark.parametrize("alone", [False, True])
def test_a_ros2_bag_is_read_as_folder_and_as_file(
    tmp_path: Path, plugin: StoragePlugin, alone: bool
) -> None:
    bag = write_bag(tmp_path / "bag", plugin, autoware_drive())
    path = next(one for one in bag.iterdir() if one.suffix in (".db3", ".mcap")) if alone else bag
    log = open_log(path)
    found = list(log.samples())
    assert not log.skipped
    assert log.info.body_from_antenna_m == (1.5, 0.0, 1.25)
    assert set(log.info.sends) == {"gnss", "speed", "status", "signals"}
    assert [channel for channel, _ in found[:4]] == ["gnss", "speed", "status", "signals"]
    # Gear and mode of one instant are one status, and the takeover is seen at its own stamp.
    statuses: list[Any] = [message for channel, message in found if channel == "status"]
    assert len(statuses) == 10
    assert {one.gear for one in statuses} == {"drive"}
    assert [one.control_mode for one in statuses] == ["autonomous"] * 5 + ["manual"] * 5
    assert statuses[5].stamp_ns == START_NS + 502 * MS
    assert found[3][1] == drive.SignalState(stamp_ns=START_NS + 3 * MS, group_id="42", colour="red")


def test_a_ros1_bag_is_read(tmp_path: Path) -> None:
    store = get_typestore(Stores.ROS1_NOETIC)
    types = store.types
    header = types["std_msgs/msg/Header"]
    time = types["builtin_interfaces/msg/Time"]
    vector = types["geometry_msgs/msg/Vector3"]
    path = tmp_path / "drive.bag"
    with Writer1(path) as writer:
        fixes = writer.add_connection("/fix", NAV_SAT_FIX, typestore=store)
        twists = writer.add_connection("/vel", TWIST_STAMPED, typestore=store)
        for tick in range(5):
            sec = 1_772_359_200 + tick
            head = header(seq=tick, stamp=time(sec=sec, nanosec=5), frame_id="gps")
            ros = types[NAV_SAT_FIX](
                header=head,
                status=types["sensor_msgs/msg/NavSatStatus"](status=0, service=1),
                latitude=52.5,
                longitude=13.4,
                altitude=30.0,
                position_covariance=fix(0, 52.5).position_covariance,
                position_covariance_type=2,
            )
            writer.write(fixes, sec * 10**9, store.serialize_ros1(ros, NAV_SAT_FIX))
            twist = types[TWIST_STAMPED](
                header=header(seq=tick, stamp=head.stamp, frame_id="base_link"),
                twist=types["geometry_msgs/msg/Twist"](
                    linear=vector(x=7.0, y=0.0, z=0.0), angular=vector(x=0.0, y=0.0, z=0.0)
                ),
            )
            writer.write(twists, sec * 10**9, store.serialize_ros1(twist, TWIST_STAMPED))
    log = open_log(path)
    found = list(log.samples())
    assert len(found) == 10
    assert found[0][1] == drive.SpeedSample(stamp_ns=START_NS + 5, speed_mps=7.0)
    assert found[1][1] == drive.GnssFix(
        stamp_ns=START_NS + 5, position=GeoPoint(52.5, 13.4, 30.0), std_m=0.5
    )


def changing() -> Iterator[tuple[str, str, Any, int]]:
    """Yield a drive whose speed topic is of another type for its last two messages."""
    for tick in range(10):
        at = START_NS + tick * 100 * MS
        yield "/fix", NAV_SAT_FIX, fix(at, 52.5), at
        if tick < 8:
            yield "/speed", VELOCITY_REPORT, velocity(at, 8.0), at
        else:
            twist = ros_type(TWIST_STAMPED)(
                header=header_from(at, "base_link"), twist=twist_from(99.0, 0.0)
            )
            yield "/speed", TWIST_STAMPED, twist, at


@pytest.mark.parametrize("kind", ["bag", "mcap"])
def test_a_topic_that_changes_its_type_is_counted_and_survived(tmp_path: Path, kind: str) -> None:
    if kind == "bag":
        path = write_bag(tmp_path / "bag", StoragePlugin.SQLITE3, changing())
    else:
        file = ForeignFile(tmp_path / "drive.mcap")
        for topic, name, message, at in changing():
            file.add(topic, name, message, at)
        path = file.close()
    log = open_log(path)
    speeds = [message.speed_mps for channel, message in log.samples() if channel == "speed"]  # type: ignore[attr-defined]
    assert speeds == [8.0] * 8
    assert log.skipped == {"topic changed its type": 2}


def test_a_damaged_chunk_ends_the_drive_and_is_counted(tmp_path: Path) -> None:
    path = tmp_path / "drive.bag"
    store = typestore()
    writer = Writer1(path)
    writer.set_compression(Writer1.CompressionFormat.BZ2)
    writer.chunk_threshold = 2000
    text, digest = get_typestore(Stores.ROS1_NOETIC).generate_msgdef(NAV_SAT_FIX)
    with writer:
        fixes = writer.add_connection("/fix", NAV_SAT_FIX, msgdef=text, md5sum=digest)
        for tick in range(50):
            at = START_NS + tick * 100 * MS
            cdr = store.serialize_cdr(fix(at, 52.5), NAV_SAT_FIX)
            writer.write(fixes, at, store.cdr_to_ros1(cdr, NAV_SAT_FIX))
    whole = path.read_bytes()
    last = whole.rindex(b"BZh") + 10
    path.write_bytes(whole[:last] + bytes(40) + whole[last + 40 :])
    log = open_log(path)
    assert 30 < len(list(log.samples())) < 50
    assert log.skipped == {"file cut short": 1}


def test_a_bag_that_was_cut_off_is_refused_in_one_line(tmp_path: Path) -> None:
    for plugin, told in (
        (StoragePlugin.SQLITE3, "malformed"),
        (StoragePlugin.MCAP, r"its \.mcap files can be read one by one"),
    ):
        bag = write_bag(tmp_path / plugin.name, plugin, autoware_drive())
        data = next(one for one in bag.iterdir() if one.suffix in (".db3", ".mcap"))
        data.write_bytes(data.read_bytes()[: 4096 * 3])
        with pytest.raises(LogError, match=f"unreadable bag: .*{told}"):
            open_log(bag)


def test_bytes_that_are_no_message_are_counted(tmp_path: Path) -> None:
    path = tmp_path / "bag"
    with Writer2(path, version=9) as writer:
        fixes = writer.add_connection("/fix", NAV_SAT_FIX, typestore=typestore())
        speeds = writer.add_connection("/speed", VELOCITY_REPORT, typestore=typestore())
        cdr = bytes(typestore().serialize_cdr(fix(START_NS, 52.5), NAV_SAT_FIX))
        for place, data in enumerate((cdr[:20], b"", bytes([9] * 40), cdr)):
            writer.write(fixes, START_NS + place, data)
        writer.write(speeds, START_NS, cdr)
    log = open_log(path)
    assert [channel for channel, _ in log.samples()] == ["gnss"]
    assert log.skipped == {"unreadable row": 4}


def test_objects_without_a_known_frame_are_counted(tmp_path: Path) -> None:
    user = drive.RoadUser(
        user_id="u",
        kind="car",
        position=GeoPoint(52.5, 13.4),
        yaw_rad=0.0,
        speed_mps=1.0,
        length_m=4.0,
        width_m=2.0,
    )
    frame = LocalFrame(GeoPoint(52.5, 13.4))
    objects = predicted_from_users(drive.RoadUsers(stamp_ns=START_NS, users=(user,)), frame)
    messages = [
        ("/fix", NAV_SAT_FIX, fix(START_NS, 52.5), START_NS),
        ("/objects", PREDICTED_OBJECTS, objects, START_NS),
    ]
    log = open_log(write_bag(tmp_path / "bag", StoragePlugin.SQLITE3, messages))
    assert [channel for channel, _ in log.samples()] == ["gnss"]
    assert log.skipped == {"objects in a frame whose origin is not known": 1}
    (tmp_path / "bag.toml").write_text(
        "body_from_antenna_m = [1, 0, 2]\n[map]\nlatitude = 52.5\nlongitude = 13.4\n"
    )
    placed = open_log(tmp_path / "bag")
    found: dict[str, Any] = dict(placed.samples())
    assert not placed.skipped
    assert placed.info.body_from_antenna_m == (1.0, 0.0, 2.0)
    assert found["objects"].users[0].position.lat_deg == pytest.approx(52.5)
    (tmp_path / "bag.toml").write_text("[map]\nlatitude = 152.5\nlongitude = 13.4\n")
    with pytest.raises(LogError, match=r"bag\.toml: \[map\] position \(152\.5, 13\.4\) is outside"):
        open_log(tmp_path / "bag")
    (tmp_path / "bag.toml").write_text("[map]\nlatitude = 52.5\n")
    with pytest.raises(LogError, match=r"bag\.toml: .*longitude"):
        open_log(tmp_path / "bag")


def test_a_recording_without_a_receiver_is_placed_by_its_odometry(tmp_path: Path) -> None:
    frame = LocalFrame(GeoPoint(52.5, 13.4))
    state = drive_messages.state(START_NS)
    odometry = odometry_from_state(state, frame)
    bag = write_bag(
        tmp_path / "bag", StoragePlugin.SQLITE3, [("/odometry", ODOMETRY, odometry, START_NS)]
    )
    with pytest.raises(LogError, match=r"no positions; .*with \[map\] declared in bag\.toml"):
        open_log(bag)
    (tmp_path / "bag.toml").write_text("[map]\nlatitude = 52.5\nlongitude = 13.4\n")
    log = open_log(bag)
    found: dict[str, Any] = dict(log.samples())
    assert set(found) == set(log.info.sends) == {"gnss", "heading", "speed"}
    assert (log.info.reference_point, log.info.body_from_antenna_m) == ("base_link", (0, 0, 0))
    assert found["gnss"].position.lat_deg == pytest.approx(state.position.lat_deg, abs=1e-9)
    assert found["heading"].yaw_rad == pytest.approx(state.yaw_rad)
    assert found["speed"].speed_mps == state.speed_mps
    odometry.header.frame_id = "odom"
    messages = [("/odometry", ODOMETRY, odometry, START_NS)]
    (tmp_path / "other.toml").write_text("[map]\nlatitude = 52.5\nlongitude = 13.4\n")
    other = open_log(write_bag(tmp_path / "other", StoragePlugin.SQLITE3, messages))
    assert [channel for channel, _ in other.samples()] == ["speed"]
    assert other.skipped == {"odometry in another frame than map": 1}


def test_files_that_are_no_bag(tmp_path: Path) -> None:
    for name, data in (("a.bag", b"#ROSBAG V2.0\n"), ("b.db3", b"SQLite format 3\0rest")):
        (tmp_path / name).write_bytes(data)
        with pytest.raises(LogError, match=f"{name}: unreadable bag"):
            open_log(tmp_path / name)
    (tmp_path / "a.bag").write_bytes(b"\x2a\x2e\xae\x57")
    with pytest.raises(LogError, match=r"a\.bag: no ROS 1 bag: it does not begin with #ROSBAG V"):
        open_log(tmp_path / "a.bag")
    (tmp_path / "a.bag").write_bytes(b"#ROSBAG V2.0\n" + bytes(range(256)) * 20)
    with pytest.raises(LogError, match=r"a\.bag: unreadable bag"):
        open_log(tmp_path / "a.bag")
    folder = tmp_path / "bag"
    folder.mkdir()
    (folder / "metadata.yaml").write_text("rosbag2_bagfile_information: {version: 4}\n")
    with pytest.raises(LogError, match=r"bag: unreadable bag: .*relative_file_paths"):
        open_log(folder)
