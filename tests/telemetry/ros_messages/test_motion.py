"""Plans of other programs: when each pose is reached, and in which frame it lies."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from foretwin.contracts import drive
from foretwin.contracts.frames import GeoPoint, LocalFrame
from foretwin.telemetry.ros_messages.foreign import FOREIGN, NO_TIMES, UnusableError
from foretwin.telemetry.ros_messages.parts import (
    TRAJECTORY,
    duration_from,
    header_from,
    pose_from,
    ros_message,
)

COVERS = ("foretwin.telemetry.ros_messages.foreign",)
FRAME = LocalFrame(GeoPoint(52.5, 13.4, 34.0))
AT = 1_772_359_200_000_000_000


def trajectory(
    x_m: list[float], speed_mps: list[float], time_s: list[float], *, frame: str = "map"
) -> Any:
    points = [
        ros_message(
            "autoware_planning_msgs/msg/TrajectoryPoint",
            time_from_start=duration_from(round(at_s * 1e9)),
            pose=pose_from(ahead_m, 0.0, 0.0, 0.0),
            longitudinal_velocity_mps=mps,
        )
        for ahead_m, mps, at_s in zip(x_m, speed_mps, time_s, strict=True)
    ]
    return ros_message(TRAJECTORY, header=header_from(AT, frame), points=points)


def plan_of(ros: Any) -> drive.PlannedTrajectory:
    (plan,) = FOREIGN[TRAJECTORY].read(ros, AT, FRAME)
    assert isinstance(plan, drive.PlannedTrajectory)
    return plan


@pytest.mark.parametrize(
    ("x_m", "speed_mps", "time_s", "reached_s"),
    [
        ([0, 1, 2, 3], [5, 5, 5, 5], [0, 0, 0, 0], [0.0, 0.2, 0.4, 0.6]),
        ([0, 4, 10], [4, 4, 8], [0, 1, 1], [0.0, 1.0, 2.0]),
        ([0, -2, -4], [-2, -2, -2], [0, 0, 0], [0.0, 1.0, 2.0]),  # in reverse
        ([0, 2, 2, 4], [2, 2, 2, 2], [0, 0, 0, 0], [0.0, 1.0, 1.0, 2.0]),
        ([0, 2, 3], [4, 0, 0], [0, 0, 0], [0.0, 1.0]),  # and from there on it stands
        ([0, 2, 2, 4], [9, 9, 9, 9], [0, 1, 1, 2], [0.0, 1.0, 1.0, 2.0]),  # its own
        ([7], [5], [0], [0.0]),
        ([], [], [], []),
    ],
)
def test_each_pose_has_its_time(
    x_m: list[float], speed_mps: list[float], time_s: list[float], reached_s: list[float]
) -> None:
    plan = plan_of(trajectory(x_m, speed_mps, time_s))
    np.testing.assert_allclose(plan.time_from_stamp_s, reached_s, atol=1e-6)
    assert len(plan.lat_deg) == len(plan.yaw_rad) == len(plan.speed_mps) == len(reached_s)


def test_a_plan_that_stands_still_and_tells_no_times_is_counted() -> None:
    with pytest.raises(UnusableError, match=NO_TIMES):
        plan_of(trajectory([0.0, 1.0, 2.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]))


def test_a_plan_in_another_frame_is_refused() -> None:
    assert len(plan_of(trajectory([0.0, 1.0], [1.0, 1.0], [0.0, 1.0], frame="/map")).lat_deg) == 2
    with pytest.raises(UnusableError, match="plan in another frame than map"):
        plan_of(trajectory([0.0, 1.0], [1.0, 1.0], [0.0, 1.0], frame="base_link"))
