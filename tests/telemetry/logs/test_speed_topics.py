"""A twist is the car's speed only where it can be: else odometry's, or none, and it is said."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest

from foretwin.contracts import drive
from foretwin.telemetry.logs import Log, open_log
from foretwin.telemetry.logs.speed_topics import COMMANDED, NOT_OF_THE_BODY, SIDEWAYS, UNTOLD
from foretwin.telemetry.ros_messages.parts import (
    NAV_SAT_FIX,
    ODOMETRY,
    TWIST_STAMPED,
    header_from,
    pose_from,
    ros_message,
    twist_from,
    vector_from,
)
from tests.telemetry.test_foreign_mcap import START_NS, ForeignFile, fix

TICKS = 10


def twist(stamp_ns: int, frame: str, x_mps: float, y_mps: float = 0.0) -> Any:
    planar = twist_from(x_mps, 0.0)
    planar.linear = vector_from(x_mps, y_mps, 0.0)
    return ros_message(TWIST_STAMPED, header=header_from(stamp_ns, frame), twist=planar)


def odometry(stamp_ns: int, speed_mps: float, *, x_m: float = 0.0, child: str = "base_link") -> Any:
    return ros_message(
        ODOMETRY,
        header=header_from(stamp_ns, "odom"),
        child_frame_id=child,
        pose=ros_message("geometry_msgs/msg/PoseWithCovariance", pose=pose_from(x_m, 0, 0, 0)),
        twist=ros_message("geometry_msgs/msg/TwistWithCovariance", twist=twist_from(speed_mps, 0)),
    )


def recording(path: Path, **said: Any) -> Log:
    """Fixes in the frame `gnss`, and beside them what each topic says, by tick and stamp."""
    file = ForeignFile(path / "drive.mcap")
    for tick in range(TICKS):
        at = START_NS + tick * 100_000_000
        one = fix(at, 52.5)
        one.header.frame_id = "gnss"
        file.add("/fix", NAV_SAT_FIX, one, at)
        for topic, say in said.items():
            message = say(tick, at)
            kind = ODOMETRY if hasattr(message, "child_frame_id") else TWIST_STAMPED
            file.add(f"/{topic}", kind, message, at)
    return open_log(file.close())


def speeds(log: Log) -> set[float]:
    return {one.speed_mps for _, one in log.samples() if isinstance(one, drive.SpeedSample)}


def test_odometry_goes_before_a_twist(tmp_path: Path) -> None:
    log = recording(
        tmp_path,
        other=lambda _, at: twist(at, "base_link", 7.0),
        odom=lambda _, at: odometry(at, 2.0),
    )
    assert speeds(log) == {2.0}
    assert log.skipped == {}


def test_odometry_of_an_unknown_body_goes_after_a_twist(tmp_path: Path) -> None:
    def odom(_: int, at: int) -> Any:
        return odometry(at, 2.0, child="velodyne")

    assert speeds(recording(tmp_path, odom=odom)) == {2.0}
    beside = recording(tmp_path, odom=odom, other=lambda _, at: twist(at, "base_link", 7.0))
    assert speeds(beside) == {7.0}


@pytest.mark.parametrize(
    ("topic", "said", "why"),
    [
        ("cmd_vel", lambda _, at: twist(at, "base_link", 15.0), COMMANDED),
        ("speed_target", lambda _, at: twist(at, "base_link", 15.0), COMMANDED),
        ("vel", lambda _, at: twist(at, "/gnss", 10.0), NOT_OF_THE_BODY),
        ("vel", lambda _, at: twist(at, "", 10.0), NOT_OF_THE_BODY),
        ("vel", lambda _, at: twist(at, "enu", 8.0, 6.0), SIDEWAYS),
        ("gps_odom", lambda tick, at: odometry(at, 0.0, x_m=float(tick)), UNTOLD),
    ],
)
def test_what_is_no_speed_of_the_car_is_left_out_and_said(
    tmp_path: Path, topic: str, said: Any, why: str
) -> None:
    alone = recording(tmp_path, **{topic: said})
    assert speeds(alone) == set()
    assert "speed" not in alone.info.sends
    assert alone.skipped == {f"{why} (/{topic}; no topic is taken)": TICKS}
    beside = recording(tmp_path, **{topic: said}, body=lambda _, at: twist(at, "base_link", 3.0))
    assert speeds(beside) == {3.0}
    assert beside.skipped == {f"{why} (/{topic}; /body is taken)": TICKS}


def test_a_car_in_a_bend_goes_ahead_all_the_same(tmp_path: Path) -> None:
    log = recording(tmp_path, vel=lambda tick, at: twist(at, "body", 5.0, 2.0 * math.sin(tick)))
    assert speeds(log) == {5.0}
    assert log.skipped == {}


def test_odometry_of_a_car_that_stands_tells_its_speed(tmp_path: Path) -> None:
    log = recording(tmp_path, odom=lambda _, at: odometry(at, 0.0))
    assert speeds(log) == {0.0}
