"""Samples of different rates on one grid."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.contracts.drive import (
    ControlCommand,
    HeadingSample,
    ImuSample,
    SpeedSample,
    SteeringSample,
    VehicleStatus,
)
from foretwin.contracts.frames import GeoPoint, LocalFrame
from foretwin.sim_worker.analysis.motion_record import MotionRecorder

FRAME = LocalFrame(GeoPoint(52.0, 13.0))
START_NS = 1_767_225_600_000_000_000


def at(time_s: float) -> int:
    return START_NS + round(time_s * 1e9)


def recorder(**options: float) -> MotionRecorder:
    return MotionRecorder(frame=FRAME, **options)  # type: ignore[arg-type]


def speed(time_s: float, value: float) -> tuple[str, SpeedSample]:
    return "speed", SpeedSample(stamp_ns=at(time_s), speed_mps=value)


def test_a_measured_signal_is_interpolated_and_a_command_holds() -> None:
    taken = recorder()
    for time_s in np.arange(0.0, 1.01, 0.05):
        taken.handle(*speed(time_s, 2.0 * time_s))
    for time_s, accel in ((0.0, 1.0), (0.4, -2.0), (0.8, 0.5)):
        command = ControlCommand(stamp_ns=at(time_s), accel_mps2=accel)
        taken.handle("control", command)
    record = taken.record()
    assert record.time_s == pytest.approx(np.arange(51) * 0.02)
    assert record.speed_mps == pytest.approx(2.0 * record.time_s)
    expected = np.where(record.time_s < 0.4 - 1e-9, 1.0, -2.0)
    expected[record.time_s >= 0.8 - 1e-9] = 0.5
    assert record.command_accel_mps2 == pytest.approx(expected)
    assert np.isnan(record.command_wheel_rad).all()
    assert not record.has("yaw_rate_radps")


def test_a_silent_sensor_leaves_a_gap_and_nothing_is_invented_outside() -> None:
    taken = recorder()
    for time_s in (0.0, 0.1, 0.2, 0.9, 1.0):
        taken.handle(*speed(time_s, 5.0))
    taken.handle("imu", ImuSample(stamp_ns=at(1.5), accel_mps2=(0, 0, 9.8), rate_radps=(0, 0, 1)))
    record = taken.record()
    known = np.isfinite(record.speed_mps)
    inside = (record.time_s <= 0.2 + 1e-9) | ((record.time_s > 0.9) & (record.time_s <= 1.0 + 1e-9))
    inside |= np.isclose(record.time_s, 0.9) & known
    assert (known == inside).all()


def test_steering_at_wheel_or_tyre_alone_is_enough() -> None:
    taken = recorder()
    for time_s in (0.0, 0.1, 0.2):
        taken.handle("steering", SteeringSample(stamp_ns=at(time_s), tire_angle_rad=0.1))
    record = taken.record()
    assert record.tire_rad == pytest.approx(0.1)
    assert np.isnan(record.wheel_rad).all()


def test_a_heading_across_the_wrap_does_not_turn_the_long_way() -> None:
    taken = recorder()
    for time_s, yaw in ((0.0, np.pi - 0.01), (0.1, -np.pi + 0.01)):
        taken.handle("heading", HeadingSample(stamp_ns=at(time_s), yaw_rad=yaw))
    turned = np.diff(taken.record().yaw_rad)
    assert turned == pytest.approx(0.02 / 5)


def test_who_drives_holds_until_told_otherwise() -> None:
    taken = recorder()
    taken.handle("status", VehicleStatus(stamp_ns=at(0.0), control_mode="manual"))
    taken.handle("status", VehicleStatus(stamp_ns=at(0.5), control_mode="autonomous"))
    for time_s in (0.0, 0.25, 0.5, 0.75, 1.0):
        taken.handle(*speed(time_s, 1.0))
    record = taken.record()
    assert (record.manual == (record.time_s < 0.5 - 1e-9)).all()


@given(order=st.permutations(range(12)), doubled=st.lists(st.integers(0, 11), max_size=5))
def test_order_and_doubles_do_not_matter(order: list[int], doubled: list[int]) -> None:
    straight, mixed = recorder(), recorder()
    for k in range(12):
        straight.handle(*speed(0.1 * k, float(k * k)))
    for k in [*order, *doubled]:
        mixed.handle(*speed(0.1 * k, float(k * k)))
    bounds = at(0.0), at(1.1)
    assert mixed.record(*bounds).speed_mps == pytest.approx(straight.record(*bounds).speed_mps)


def test_what_is_kept_is_bounded_and_what_is_not_finite_passed_over() -> None:
    taken = recorder(keep_s=1.0)
    for k in range(500):
        taken.handle(*speed(0.01 * k, float("nan") if k % 2 else 1.0))
    record = taken.record()
    assert record.time_s[-1] == pytest.approx(1.0, abs=0.03)
    assert record.speed_mps == pytest.approx(1.0)


def test_an_empty_recorder_says_so() -> None:
    with pytest.raises(ValueError, match="no sample"):
        recorder().record()


def test_a_gyro_alone_tells_of_no_force() -> None:
    taken = recorder()
    for k in range(10):
        told = ImuSample(stamp_ns=at(0.02 * k), accel_mps2=(0, 0, 0), rate_radps=(0, 0, 1))
        taken.handle("imu", told)
    assert not taken.record().has("accel_x_mps2")
    assert taken.record().has("yaw_rate_radps")
