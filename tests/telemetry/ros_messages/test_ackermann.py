"""Ackermann's acceleration is a magnitude: what a car is told is known by the speeds."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest

from foretwin.contracts import drive
from foretwin.telemetry.logs import Log, open_log
from foretwin.telemetry.ros_messages.ackermann import (
    HARDLY_MPS2,
    NO_ACCELERATION,
    AckermannCommands,
    AckermannTarget,
    target_from_ros,
)
from foretwin.telemetry.ros_messages.commands import ackermann_from_command, ackermann_view
from foretwin.telemetry.ros_messages.parts import (
    ACKERMANN,
    VELOCITY_REPORT,
    header_from,
    ros_message,
)
from tests.telemetry.autoware_messages import velocity_report
from tests.telemetry.test_foreign_mcap import START_NS, ForeignFile, fix

TICK_NS = 100_000_000


def asked(stamp_ns: int, speed_mps: float, limit_mps2: float) -> Any:
    drive_ = ros_message(
        "ackermann_msgs/msg/AckermannDrive",
        steering_angle=0.125,
        speed=speed_mps,
        acceleration=limit_mps2,
    )
    return ros_message(ACKERMANN, header=header_from(stamp_ns, "base_link"), drive=drive_)


def recorded(path: Path, speeds_mps: list[float], *, measured_mps: float | None) -> Log:
    """A recording of a car that is asked for one speed after the other, by 3 m/s² at most."""
    file = ForeignFile(path / "drive.mcap")
    for tick, speed_mps in enumerate(speeds_mps):
        at = START_NS + tick * TICK_NS
        file.add("/fix", "sensor_msgs/msg/NavSatFix", fix(at, 52.5), at)
        if measured_mps is not None:
            said = velocity_report(at - 1, speed_mps=measured_mps, yaw_rate_radps=0.0)
            file.add("/speed", VELOCITY_REPORT, said, at)
        file.add("/drive", ACKERMANN, asked(at, speed_mps, 3.0), at)
    return open_log(file.close())


def accelerations(log: Log) -> list[float]:
    return [one.accel_mps2 for _, one in log.samples() if isinstance(one, drive.ControlCommand)]


def test_a_speed_below_the_cars_is_braking(tmp_path: Path) -> None:
    log = recorded(tmp_path, [9.0, 8.0, 10.0, 12.0], measured_mps=10.0)
    assert accelerations(log) == [-3.0, -3.0, 0.0, 3.0]
    assert not log.skipped


def test_without_a_measured_speed_the_change_of_the_commanded_one_tells(tmp_path: Path) -> None:
    log = recorded(tmp_path, [10.0, 9.0, 8.0, 8.0, 9.0], measured_mps=None)
    assert accelerations(log) == [-3.0, -3.0, 3.0]
    assert log.skipped == {NO_ACCELERATION: 2}


def signed(target: AckermannTarget, *, measured_mps: float, age_ns: int = 0) -> float | None:
    commands = AckermannCommands()
    commands.note(drive.SpeedSample(stamp_ns=START_NS - age_ns, speed_mps=measured_mps))
    command = commands.command(target)
    return None if command is None else command.accel_mps2


@pytest.mark.parametrize(
    ("speed_mps", "limit_mps2", "age_ns", "accel_mps2"),
    [
        (4.0, 0.0, 0, None),  # as hard as possible: how hard is not known
        (5.05, 0.0, 0, 0.0),  # the speed is held
        (5.05, 3.0, 0, 0.0),
        (9.0, -2.0, 0, -2.0),  # no magnitude, and plainly braking
        (-2.0, 1.0, 0, -1.0),  # backwards
        (4.0, 3.0, 500_000_000, -3.0),
        (4.0, 3.0, 500_000_001, None),
        (math.nan, 3.0, 0, None),
    ],
)
def test_what_a_target_means_to_a_car_at_5_mps(
    speed_mps: float, limit_mps2: float, age_ns: int, accel_mps2: float | None
) -> None:
    target = AckermannTarget(
        stamp_ns=START_NS, speed_mps=speed_mps, limit_mps2=limit_mps2, tire_angle_rad=0.0
    )
    assert signed(target, measured_mps=5.0, age_ns=age_ns) == accel_mps2


@pytest.mark.parametrize("accel_mps2", [-2.5, 1.5])
def test_what_goes_out_is_read_back_by_a_car_that_drives(accel_mps2: float) -> None:
    command = drive.ControlCommand(stamp_ns=START_NS, accel_mps2=accel_mps2, tire_angle_rad=0.125)
    ros = ackermann_from_command(command, speed_mps=8.0)
    assert ros.drive.acceleration == abs(accel_mps2)
    commands = AckermannCommands()
    commands.note(drive.SpeedSample(stamp_ns=START_NS, speed_mps=5.0))
    assert commands.command(target_from_ros(ros, START_NS)) == command


def test_no_acceleration_is_never_sent_as_the_hardest() -> None:
    command = drive.ControlCommand(stamp_ns=START_NS, accel_mps2=0.0, tire_angle_rad=0.0)
    sent = ackermann_from_command(command, speed_mps=8.0).drive
    assert (sent.acceleration, sent.speed) == (HARDLY_MPS2, 8.0)


@pytest.mark.parametrize(("accel_mps2", "speed_mps"), [(-2.0, 0.0), (2.0, math.nan)])
def test_a_view_tells_braking_by_a_standstill(accel_mps2: float, speed_mps: float) -> None:
    command = drive.ControlCommand(stamp_ns=START_NS, accel_mps2=accel_mps2)
    shown = ackermann_view(command, None).drive
    assert shown.acceleration == 2.0
    assert shown.speed == pytest.approx(speed_mps, nan_ok=True)
    assert math.isnan(shown.steering_angle)
