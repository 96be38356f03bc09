"""Lidars in a notebook: a scan, virtual cars in a real cloud, and files that others read."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_typestore

import foretwin
from foretwin.contracts.frames import GeoPoint
from foretwin.telemetry.ros_messages.parts import typestore


@pytest.fixture(scope="module")
def car(world: foretwin.World) -> foretwin.VehicleState:
    return foretwin.state_on(world, foretwin.ways_through(world)[0])


def ahead(world: foretwin.World, car: foretwin.VehicleState) -> list[Any]:
    """A van 15 m before the car's rear axle, standing in its lane."""
    way = foretwin.ways_through(world)[0]
    x, y = way.path.point_at(np.array([way.entry_m - 40.0 + 15.0]))[0]
    yaw = float(way.path.pose_at(np.array([way.entry_m - 40.0 + 15.0])).yaw_rad[0])
    return [foretwin.road_user(world, "van", x, y, yaw_rad=yaw)]


def test_a_scan_sees_the_world_and_who_is_put_into_it(
    world: foretwin.World, car: foretwin.VehicleState
) -> None:
    car = msgspec.structs.replace(car, speed_mps=0.0)
    users = ahead(world, car)
    seen = foretwin.lidar_scan(world, car, users, "vlp_16")
    alone = foretwin.lidar_scan(world, car, users, "vlp_16", users_alone=True, seed=1)

    assert seen.points.shape[1] == 6
    assert len(seen.points) > 5 * len(alone.points) > 500
    # Its rear is 15 m less half a van's 6 m before the rear axle.
    assert np.median(alone.points[:, 0]) == pytest.approx(12.0, abs=0.05)
    assert (seen.body >= 0).sum() == pytest.approx((alone.body >= 0).sum(), rel=0.05)
    merged = foretwin.merge_clouds(foretwin.lidar_scan(world, car, sensor="vlp_16").points, alone)
    assert len(merged) == pytest.approx(len(seen.points), rel=0.01)


def test_clouds_are_files_that_ros_reads(
    world: foretwin.World, car: foretwin.VehicleState, tmp_path: Path
) -> None:
    points = foretwin.lidar_scan(world, car).points
    file = foretwin.save_clouds(tmp_path / "scan.mcap", [(1.5, points), (1.6, points[:100])])

    with Reader(file) as reader:
        rows = list(reader.messages())
        store = get_typestore(Stores.ROS2_JAZZY)
        clouds = [store.deserialize_cdr(data, row.msgtype) for row, _, data in rows]
    assert [(row.topic, row.msgtype) for row, _, _ in rows] == 2 * [
        ("/foretwin/points", "sensor_msgs/msg/PointCloud2")
    ]
    assert [cloud.width for cloud in clouds] == [len(points), 100]
    assert clouds[0].header.stamp.nanosec == 500_000_000


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"sensor": "nosuch"}, "no bundled sensor of that name: gnss_standard"),
        ({"sensor": 5}, "sensor must be a path"),
        ({"seed": -1}, "whole number from 0"),
        ({"road_users": [5]}, "a road user must be a RoadUser"),
        ({"world": 5}, "world must be a World"),
        ({"state": 5}, "state must be a VehicleState"),
    ],
)
def test_mistakes_are_told(
    given: dict[str, Any], said: str, world: foretwin.World, car: foretwin.VehicleState
) -> None:
    with pytest.raises(foretwin.UserError, match=said) as raised:
        foretwin.lidar_scan(**{"world": world, "state": car} | given)
    assert "\n" not in str(raised.value)


def test_other_mistakes_are_told(
    world: foretwin.World, car: foretwin.VehicleState, tmp_path: Path
) -> None:
    nowhere = msgspec.structs.replace(car, position=GeoPoint(math.nan, 0.0))
    scan = foretwin.lidar_scan(world, car, users_alone=True)
    for call, said in (
        (lambda: foretwin.lidar_scan(world, nowhere), "is not finite"),
        (lambda: foretwin.road_user(world, "cat", 0, 0), "kind 'cat'"),
        (lambda: foretwin.road_user(world, "car", math.nan, 0), "must be finite"),
        (lambda: foretwin.merge_clouds(np.zeros((5, 3)), scan), r"shape \(5, 3\); \(N, 6\): x, y"),
        (lambda: foretwin.merge_clouds("points", scan), "an array of numbers"),
        (lambda: foretwin.merge_clouds(np.zeros((5, 6)), 5), "virtual must be a LidarScan"),
        (lambda: foretwin.save_clouds(tmp_path, []), "directory"),
        (lambda: foretwin.save_clouds(tmp_path / "x.mcap", [(-1, np.zeros((1, 6)))]), "stamp"),
    ):
        with pytest.raises(foretwin.UserError, match=said):
            call()


def test_a_radar_lists_who_is_ahead_and_its_lists_are_files_that_ros_reads(
    world: foretwin.World, car: foretwin.VehicleState, tmp_path: Path
) -> None:
    car = msgspec.structs.replace(car, speed_mps=5.0)
    found = foretwin.radar_list(world, car, ahead(world, car))
    file = foretwin.save_radar_lists(tmp_path / "radar.mcap", [(1.5, found)])

    # Its rear is 12 m before the rear axle, the radar 3.6 m.
    assert found.returns[0, [0, 1, 3]] == pytest.approx([8.4, 0.0, -5.0], abs=0.8)
    with Reader(file) as reader:
        ((row, _, data),) = reader.messages()
        scan = typestore().deserialize_cdr(data, row.msgtype)
    assert (row.topic, row.msgtype) == ("/foretwin/radar", "radar_msgs/msg/RadarScan")
    assert scan.header.frame_id == "long_range_radar"
    assert scan.returns[0].range == found.returns[0, 0]
    with pytest.raises(foretwin.UserError, match="vlp_16: of kind lidar, and radar is needed"):
        foretwin.radar_list(world, car, sensor="vlp_16")
    with pytest.raises(foretwin.UserError, match="of kind radar, and lidar is needed"):
        foretwin.lidar_scan(world, car, sensor="long_range_radar")


def test_a_camera_sees_who_is_ahead_and_its_pictures_are_files_that_ros_reads(
    world: foretwin.World, car: foretwin.VehicleState, tmp_path: Path
) -> None:
    try:
        view = foretwin.camera_view(world, car, ahead(world, car))
    except foretwin.UserError as why:
        pytest.skip(str(why))
    file = foretwin.save_pictures(tmp_path / "camera.mcap", [(1.5, view)])

    assert view.rgb.shape == (480, 640, 3)
    assert view.depth_m[view.body == 0].min() == pytest.approx(12.0 - 1.7, abs=0.3)
    with Reader(file) as reader:
        assert [row.msgtype for row, _, _ in reader.messages()] == [
            "sensor_msgs/msg/CompressedImage", "sensor_msgs/msg/CameraInfo"
        ]  # fmt: skip
    with pytest.raises(foretwin.UserError, match="of kind lidar, and camera is needed"):
        foretwin.camera_view(world, car, sensor="vlp_16")


def test_receivers_and_inertial_sensors_measure_a_drive(
    car: foretwin.VehicleState, tmp_path: Path
) -> None:
    states = [msgspec.structs.replace(car, stamp_ns=k * 100_000_000) for k in range(5)]
    fixes = foretwin.motion_samples(states, "gnss_standard", seed=3)
    samples = foretwin.motion_samples(states, "imu_mems")
    files = [
        foretwin.save_samples(tmp_path / f"{k}.mcap", one) for k, one in enumerate((fixes, samples))
    ]

    assert [one.stamp_ns for one in fixes] == [one.stamp_ns for one in states]
    for file, kind in zip(files, ("NavSatFix", "Imu"), strict=True):
        with Reader(file) as reader:
            assert [row.msgtype for row, _, _ in reader.messages()] == 5 * [
                f"sensor_msgs/msg/{kind}"
            ]
    with pytest.raises(foretwin.UserError, match="of kind lidar, and imu is needed"):
        foretwin.motion_samples(states, "vlp_16")
