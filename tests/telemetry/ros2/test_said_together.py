"""What a vehicle says live, and what of it belongs together, becomes samples."""

from __future__ import annotations

from typing import Any

import msgspec
import numpy as np
import pytest

from foretwin.contracts import drive
from foretwin.contracts.arrays import Array
from foretwin.contracts.foreign_bus import Arrived
from foretwin.telemetry.logs.mountings import NOT_UPRIGHT
from foretwin.telemetry.ros2.inwards import Inwards
from foretwin.telemetry.ros2.mapping import parse_mapping
from foretwin.telemetry.ros_messages.ackermann import NO_ACCELERATION
from foretwin.telemetry.ros_messages.parts import ACKERMANN, ODOMETRY, VELOCITY_REPORT, typestore
from tests.telemetry.autoware_messages import velocity_report
from tests.telemetry.logs.test_mountings import (
    FORCE,
    IMU,
    RATE,
    SIDE,
    TF,
    TURNED,
    UPRIGHT,
    UPSIDE_DOWN,
    measured,
    static_transform,
)
from tests.telemetry.ros_messages.test_ackermann import asked
from tests.telemetry.ros_messages.test_odometry import MOUNT, SPEED_MPS, of_the_lidar

COVERS = ("foretwin.telemetry.ros2.inwards",)
S = 10**9
AT = 1_772_359_200 * S


def listening(**kinds: tuple[str, str]) -> Inwards:
    """Listen to topics, each of a type and a channel."""
    rows = [
        f'[[in]]\ntopic = "/{topic}"\ntype = "{kind}"\nchannel = "{channel}"\n'
        for topic, (kind, channel) in kinds.items()
    ]
    return Inwards(parse_mapping('dialect = "ros2dds"\n' + "".join(rows), name="m.toml"))


def heard(inwards: Inwards, topic: str, kind: str, message: Any) -> list[msgspec.Struct]:
    """Return the samples of a message."""
    data = bytes(typestore().serialize_cdr(message, kind))
    return [sample for _, sample in inwards.take(Arrived(topic, data, None, S, AT))]


def test_what_ackermann_asks_for_is_known_by_the_measured_speed() -> None:
    inwards = listening(drive=(ACKERMANN, "control"), speed=(VELOCITY_REPORT, "speed"))
    assert heard(inwards, "drive", ACKERMANN, asked(AT, 7.0, 3.0)) == []
    assert inwards.unused == {f"/drive: {NO_ACCELERATION}": 1}
    said = velocity_report(AT + 1, speed_mps=10.0, yaw_rate_radps=0.0)
    heard(inwards, "speed", VELOCITY_REPORT, said)
    assert heard(inwards, "drive", ACKERMANN, asked(AT + 2, 7.0, 3.0)) == [
        drive.ControlCommand(stamp_ns=AT + 2, accel_mps2=-3.0, tire_angle_rad=0.125)
    ]


@pytest.mark.parametrize("mounted", [UPRIGHT, SIDE, UPSIDE_DOWN, TURNED])
def test_an_inertial_unit_is_turned_into_the_cars_axes(mounted: Array) -> None:
    inwards = listening(imu=(IMU, "imu"), tf_static=(TF, "transforms"))
    heard(inwards, "tf_static", TF, static_transform(mounted))
    (sample,) = heard(inwards, "imu", IMU, measured(AT, mounted.T @ FORCE, mounted.T @ RATE))
    assert isinstance(sample, drive.ImuSample)
    assert sample.accel_mps2 == pytest.approx(FORCE.tolist())
    assert sample.rate_radps == pytest.approx(RATE.tolist())


@pytest.mark.parametrize("mounted", [SIDE, UPSIDE_DOWN])
def test_one_that_is_not_upright_is_left_out_until_a_transform_tells_how_it_sits(
    mounted: Array,
) -> None:
    inwards = listening(imu=(IMU, "imu"), tf_static=(TF, "transforms"))
    said = measured(AT, mounted.T @ FORCE, mounted.T @ RATE)
    assert heard(inwards, "imu", IMU, said) == []
    assert inwards.unused == {f"/imu: {NOT_UPRIGHT}": 1}
    heard(inwards, "tf_static", TF, static_transform(mounted))
    assert len(heard(inwards, "imu", IMU, said)) == 1


def test_a_jolt_does_not_make_a_unit_lie_on_its_side() -> None:
    inwards = listening(imu=(IMU, "imu"))
    said = [measured(AT + n, FORCE, RATE) for n in range(3)]
    said.append(measured(AT + 3, np.array([0.0, 9.8, 0.0]), RATE))
    assert [len(heard(inwards, "imu", IMU, one)) for one in said] == [1, 1, 1, 1]


def test_axes_that_the_mapping_declares_are_not_turned_again() -> None:
    down = UPSIDE_DOWN
    rows = f'''dialect = "ros2dds"
[[in]]
topic = "/imu"
type = "{IMU}"
channel = "imu"
axes = "forward_right_down"
[[in]]
topic = "/tf_static"
type = "{TF}"
channel = "transforms"
'''
    inwards = Inwards(parse_mapping(rows, name="m.toml"))
    heard(inwards, "tf_static", TF, static_transform(down))
    (sample,) = heard(inwards, "imu", IMU, measured(AT, down.T @ FORCE, down.T @ RATE))
    assert isinstance(sample, drive.ImuSample)
    assert sample.accel_mps2 == pytest.approx(FORCE.tolist())


def test_the_speed_of_a_lidar_becomes_base_links() -> None:
    inwards = listening(odom=(ODOMETRY, "speed"), tf_static=(TF, "transforms"))
    heard(inwards, "tf_static", TF, MOUNT)
    (sample,) = heard(inwards, "odom", ODOMETRY, of_the_lidar(AT))
    assert isinstance(sample, drive.SpeedSample)
    assert sample.speed_mps == pytest.approx(SPEED_MPS)
