"""Odometry of a lidar, which does not move as the car's rear axle does, becomes base_link's."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest

from foretwin.contracts import drive
from foretwin.telemetry.logs import Log, LogError, open_log
from foretwin.telemetry.ros_messages.odometry import is_of_base, of_base
from foretwin.telemetry.ros_messages.parts import (
    ODOMETRY,
    TF,
    header_from,
    pose_from,
    ros_message,
    twist_from,
    vector_from,
    yaw_of,
)
from foretwin.telemetry.ros_messages.transforms import TransformTree
from tests.telemetry.autoware_messages import transform_message
from tests.telemetry.test_foreign_mcap import START_NS, ForeignFile

AHEAD_M, LEFT = 2.0, 0.5 * math.pi
"""The lidar stands so far ahead of base_link, and its x looks to the left."""
MOUNT = transform_message(
    0, parent="base_link", child="lidar", place_m=(AHEAD_M, 0.0, 1.5), yaw_rad=LEFT
)
SPEED_MPS, RATE_RADPS = 5.0, 0.4
YAW_RAD = 0.25


def of_the_lidar(stamp_ns: int, *, child: str = "lidar") -> Any:
    """The car at (10, 20) in map, which turns: its lidar is ahead of it and swings to the left."""
    x_m, y_m = 10.0 + AHEAD_M * math.cos(YAW_RAD), 20.0 + AHEAD_M * math.sin(YAW_RAD)
    twist = twist_from(0.0, RATE_RADPS)
    twist.linear = vector_from(RATE_RADPS * AHEAD_M, -SPEED_MPS, 0.0)
    return ros_message(
        ODOMETRY,
        header=header_from(stamp_ns, "map"),
        child_frame_id=child,
        pose=ros_message(
            "geometry_msgs/msg/PoseWithCovariance", pose=pose_from(x_m, y_m, 1.5, YAW_RAD + LEFT)
        ),
        twist=ros_message("geometry_msgs/msg/TwistWithCovariance", twist=twist),
    )


def mounted() -> TransformTree:
    tree = TransformTree()
    tree.add(MOUNT)
    return tree


def test_pose_and_twist_are_moved_to_base_link() -> None:
    moved = of_base(of_the_lidar(START_NS), mounted())
    at, linear = moved.pose.pose.position, moved.twist.twist.linear
    assert (at.x, at.y, at.z) == pytest.approx((10.0, 20.0, 0.0))
    assert yaw_of(moved.pose.pose.orientation) == pytest.approx(YAW_RAD)
    assert (linear.x, linear.y, linear.z) == pytest.approx((SPEED_MPS, 0.0, 0.0))
    assert moved.twist.twist.angular.z == pytest.approx(RATE_RADPS)
    assert is_of_base(moved)


@pytest.mark.parametrize(
    ("child", "base"), [("base_link", True), ("/base_footprint", True), ("", False)]
)
def test_what_is_base_links_or_leads_nowhere_stays(child: str, base: bool) -> None:
    ros = of_the_lidar(START_NS, child=child)
    assert of_base(ros, mounted()) is ros
    assert is_of_base(ros) is base


def recorded(path: Path, *, declared: str = "", transforms: bool = False) -> Log:
    file = ForeignFile(path / "drive.mcap")
    if transforms:
        file.add("/tf_static", TF, MOUNT, START_NS)
    for tick in range(3):
        at = START_NS + tick * 100_000_000
        file.add("/odometry", ODOMETRY, of_the_lidar(at), at)
    declaration = f"{declared}\n[map]\nlatitude = 52.5\nlongitude = 13.4\n"
    (path / "drive.mcap.toml").write_text(declaration)
    return open_log(file.close())


def first(log: Log, kind: type[Any]) -> Any:
    return next(one for _, one in log.samples() if isinstance(one, kind))


def test_a_recording_with_transforms_gives_base_links_positions(tmp_path: Path) -> None:
    log = recorded(tmp_path, transforms=True)
    assert first(log, drive.HeadingSample).yaw_rad == pytest.approx(YAW_RAD, abs=1e-5)
    assert first(log, drive.SpeedSample).speed_mps == pytest.approx(SPEED_MPS)
    lat_deg = first(log, drive.GnssFix).position.lat_deg
    assert (lat_deg - 52.5) * 111_260.0 == pytest.approx(20.0, abs=0.05)
    assert log.skipped == {}


def test_without_any_it_is_refused_in_a_line_that_says_what_would_do(tmp_path: Path) -> None:
    with pytest.raises(LogError, match=r"odometry of 'lidar', not of base_link.*body_from_antenna"):
        recorded(tmp_path)


def test_a_declared_place_stands_in_for_a_transform(tmp_path: Path) -> None:
    log = recorded(tmp_path, declared=f"body_from_antenna_m = [0.0, -{AHEAD_M}, 1.5]")
    # Its axes are taken for the car's, and so its place is told in them.
    lat_deg = first(log, drive.GnssFix).position.lat_deg
    assert (lat_deg - 52.5) * 111_260.0 == pytest.approx(20.0, abs=0.05)
    assert log.info.reference_point == "base_link"
