"""Clouds through the gateway: virtual and merged ones out, real ones in, nothing back as real."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

from foretwin.contracts.anchor import Anchor, AnchorPose
from foretwin.contracts.arrays import Array32
from foretwin.contracts.bounds import MOST_ROS_BYTES
from foretwin.contracts.bus import Mailbox
from foretwin.contracts.point_cloud import Mount, PointCloud, mount_from_base_cloud
from foretwin.telemetry.ros2.gateway import Gateway
from foretwin.telemetry.ros2.mapping import parse_mapping
from foretwin.telemetry.ros_messages.clouds import cloud_from, cloud_of
from foretwin.telemetry.ros_messages.parts import POINT_CLOUD2, typestore
from tests.telemetry.ros2.gateway_ground import FIX_KEY, FRAME, fix, mapping_text
from tests.telemetry.ros2.passing_ground import PERCEPTION, PassingGround, S
from tests.telemetry.ros2.test_merged_objects import VAN, user

COVERS = ("foretwin.telemetry.ros2.inwards",)

MORE = f"""{PERCEPTION}
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
frame = "velodyne_top"
layout = "autoware"
[[out]]
topic = "/foretwin/points"
type = "sensor_msgs/msg/PointCloud2"
source = "point_cloud"
sensor = "top"
[[out]]
topic = "/lidar/users"
type = "sensor_msgs/msg/PointCloud2"
source = "point_cloud"
sensor = "users_only"
"""
MOUNT = Mount(forward_m=1.0, left_m=0.2, up_m=2.0, yaw_deg=90.0)
POINTS = np.array([[6.0, 0.2, 2.0, 40.0, 3.0, 0.01], [1.0, 5.2, 1.0, 7.0, 9.0, 0.05]], np.float32)
RAW = "0/lidar/raw/sensor_msgs::msg::dds_::PointCloud2_/RIHS01_x"


class Passing(PassingGround):
    def __init__(self, *, flag: bool = True, anchor: Anchor | None = None) -> None:
        super().__init__(MORE, flag=flag, anchor=anchor)
        self.gateway = Gateway(
            parse_mapping(mapping_text(enabled=True, more=MORE), name="m.toml"),
            bus=self.bus, foreign=self.foreign, run_id="r", vehicle_id="ego", drive_frame=FRAME,
            flag_on=flag, order_keys=self.orders.keys, anchor=anchor, mounts={"top": MOUNT},
            mono_ns=lambda: self.now_ns, wall_ns=lambda: 10**18 + self.now_ns,
        )  # fmt: skip
        self.real = Mailbox(10)
        self.bus.subscribe("real_cloud", self.real, vehicle="ego")
        self.goes_on()

    def told(self, points: Array32 = POINTS, stamp_ns: int = 5 * S, sensor: str = "top") -> None:
        self.passes("point_cloud", PointCloud(stamp_ns=stamp_ns, points=points, sensor=sensor))

    def hears(
        self, points: Array32 = POINTS, *, stamp_ns: int = 5 * S, frame: str = "lidar"
    ) -> None:
        ros = cloud_from(PointCloud(stamp_ns=stamp_ns, points=points), frame_id=frame)
        self.arrive(RAW, bytes(typestore().serialize_cdr(ros, POINT_CLOUD2)))

    def sent(self, topic: str = "/lidar/merged") -> list[Any]:
        return self.heard_on(topic, POINT_CLOUD2)


def test_a_cloud_goes_out_in_the_sensors_frame_and_in_base_link() -> None:
    ground = Passing()
    ground.told()
    ground.told(sensor="another")
    (theirs,), (ours,) = ground.sent(), ground.sent("/foretwin/points")

    assert (theirs.header.frame_id, ours.header.frame_id) == ("velodyne_top", "base_link")
    assert (theirs.point_step, ours.point_step) == (32, 22)
    seen = cloud_of(theirs, 5 * S).points
    # 5 m ahead of the car is 5 m to the right of a sensor that looks to the left.
    assert seen[0] == pytest.approx([0.0, -5.0, 0.0, 40.0, 3.0, 0.01], abs=1e-5)
    assert seen == pytest.approx(mount_from_base_cloud(POINTS, MOUNT), abs=1e-5)
    assert cloud_of(ours, 5 * S).points == pytest.approx(POINTS)


def test_without_the_second_switch_only_what_is_below_foretwin_goes_out() -> None:
    ground = Passing(flag=False)
    ground.told()
    assert (len(ground.sent()), len(ground.sent("/foretwin/points"))) == (0, 1)
    assert ground.gateway.held["/lidar/merged"] == 1


def test_when_the_word_is_overdue_no_cloud_goes_to_the_vehicle() -> None:
    ground = Passing()
    ground.told()
    ground.is_overdue("point_cloud", PointCloud(stamp_ns=6 * S, points=POINTS, sensor="top"))
    assert (len(ground.sent()), len(ground.sent("/foretwin/points"))) == (1, 2)


def test_a_real_cloud_comes_in_base_link() -> None:
    ground = Passing()
    ground.hears(mount_from_base_cloud(POINTS, MOUNT))
    ground.hears(POINTS, frame="base_link", stamp_ns=6 * S)
    for stamp_ns in (5 * S, 6 * S):
        item = ground.real.take()
        assert item is not None
        cloud = item.message()
        assert cloud.points == pytest.approx(POINTS, abs=1e-5)
        assert (cloud.stamp_ns, cloud.sensor) == (stamp_ns, "top")


def test_a_cloud_may_be_larger_than_other_messages() -> None:
    ground = Passing()
    points = np.tile(POINTS, (120_000, 1))
    assert points.nbytes > MOST_ROS_BYTES
    ground.hears(points, frame="base_link")
    item = ground.real.take()
    assert item is not None
    assert len(item.message().points) == len(points)


def test_a_car_on_a_small_mirrored_lot_has_small_mirrored_clouds() -> None:
    lot = AnchorPose(lat_deg=52.5, lon_deg=13.4, yaw_deg=0.0)
    ground = Passing(anchor=Anchor(lot=lot, world=lot, scale=10.0, mirrored=True))
    ground.told()
    (there,) = ground.sent("/foretwin/points")
    on_lot = cloud_of(there, 5 * S).points
    assert on_lot[:, :3] == pytest.approx(POINTS[:, :3] * (0.1, -0.1, 0.1))
    ground.hears(cloud_of(ground.sent()[0], 0).points, stamp_ns=6 * S)
    item = ground.real.take()
    assert item is not None
    assert item.message().points[:, :3] == pytest.approx(POINTS[:, :3], abs=1e-4)


def test_a_cloud_that_was_sent_does_not_come_back_as_real() -> None:
    ground = Passing()
    ground.told(stamp_ns=5 * S)
    ground.hears(POINTS * np.float32(2.0), stamp_ns=5 * S)
    assert ground.real.take() is None
    assert ground.gateway.inwards.unused["/lidar/raw: a cloud that we have sent"] == 1
    ground.hears(POINTS, stamp_ns=5 * S + 1)
    assert ground.real.take() is not None


def test_a_cloud_that_went_out_for_another_lidar_keeps_no_real_one_out() -> None:
    """All sensors of a simulated car say one stamp."""
    ground = Passing()
    ground.told(stamp_ns=5 * S, sensor="users_only")
    ground.hears(POINTS, stamp_ns=5 * S)
    assert ground.real.take() is not None


def test_whom_the_stack_perceives_in_our_points_is_not_real() -> None:
    """Perception gives them ids and sizes of its own."""
    ground = Passing()
    ground.holds_a_van_that_is_none()
    ground.told()

    def perceived(*places: tuple[float, float]) -> int:
        seen = [user(f"{k}" * 32, *at, van=True, virtual=False) for k, at in enumerate(places)]
        return ground.perceives([replace(one, length_m=3.7) for one in seen])

    # The van points to the north: 5 m along y, 2 m along x.
    assert perceived((20.6, 10.0), (20.0, 5.5)) == 0
    assert perceived((22.0, 8.0), (20.0, 12.0)) == 2
    assert VAN not in ground.gateway.inwards.unused


def test_what_no_lidar_of_the_drive_says_is_left_out() -> None:
    ground = Passing()
    ground.gateway.inwards._mounts = {}
    ground.hears()
    assert ground.gateway.inwards.unused["/lidar/raw: no sensor 'top' in the drive"] == 1


def test_of_clouds_that_come_too_fast_the_newest_eight_go_out() -> None:
    """Virtual ones and real ones; the car's other samples wait elsewhere."""
    passing = Passing()
    for number in range(20):
        cloud = PointCloud(stamp_ns=5 * S + number, points=POINTS, sensor="top")
        passing.bus.publish("point_cloud", cloud, run="r")
    passing.goes_on()
    assert passing.gateway.report()["dropped"] == {
        "samples": 0, "words": 0, "views": 0, "clouds": 12,
    }  # fmt: skip
    stamps = [
        one.header.stamp.nanosec for one in passing.heard_on("/foretwin/points", POINT_CLOUD2)
    ]
    assert stamps == list(range(12, 20))


def test_clouds_that_wait_keep_no_sample_out_and_the_newest_are_passed_on() -> None:
    passing = Passing()
    ros = cloud_from(PointCloud(stamp_ns=5 * S, points=POINTS), frame_id="lidar")
    cloud = bytes(typestore().serialize_cdr(ros, POINT_CLOUD2))
    for key, payload in (*((RAW, cloud) for _ in range(11)), (FIX_KEY, fix(5 * S, 52.5, 13.4))):
        passing.foreign.arrive(key, payload, mono_ns=passing.now_ns)
    passing.step()
    dropped = passing.gateway.report()["dropped"]
    assert (dropped["clouds"], dropped["samples"]) == (3, 0)
    assert passing.gateway.report()["in"]["gnss"] == 1
