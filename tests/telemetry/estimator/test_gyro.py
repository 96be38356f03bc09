"""What a gyro tells of itself, and what the filter makes of it while the car stands."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.contracts.drive import ImuSample, SpeedSample
from foretwin.telemetry.estimator.filter_state import YAW, X
from foretwin.telemetry.estimator.gyro import Gyro
from foretwin.telemetry.estimator.kinematic_filter import KinematicFilter
from foretwin.telemetry.estimator.motion_track import MotionTrack
from foretwin.telemetry.estimator.yaw_rates import correct_gyro
from tests.telemetry.position_track import fix, info

MS = 1_000_000


def watched(
    *,
    std_radps: float,
    period_ms: int = 10,
    loss: float = 0.0,
    bias_radps: float = 0.0,
    standing: bool = False,
    seconds: float = 20.0,
) -> Gyro:
    """Return a gyro that was watched while the car wound its way, or stood."""
    random = np.random.default_rng(7)
    gyro = Gyro()
    for at_ms in range(0, round(seconds * 1000), period_ms):
        turning = 0.0 if standing else 0.5 * math.sin(2.0 * math.pi * 0.3 * at_ms / 1000.0)
        rate = turning + bias_radps + random.normal(0.0, std_radps)
        if random.random() >= loss:
            gyro.take(at_ms * MS, rate, standing=standing)
    return gyro


@pytest.mark.parametrize("loss", [0.0, 0.3])
@pytest.mark.parametrize("std_radps", [0.0015, 0.003])
def test_white_noise_is_told_from_turning(std_radps: float, loss: float) -> None:
    assert watched(std_radps=std_radps, loss=loss).std_radps == pytest.approx(std_radps, rel=0.2)


def test_noise_has_its_bounds_and_slow_gyros_are_not_judged() -> None:
    assert watched(std_radps=0.0).std_radps == 0.001
    assert watched(std_radps=0.05).std_radps == 0.005
    assert watched(std_radps=0.0015, period_ms=100).std_radps == 0.005


def test_the_bias_is_learnt_while_the_car_stands_and_only_then() -> None:
    stood = watched(std_radps=0.002, bias_radps=0.004, standing=True, seconds=2.0)
    assert stood.bias_std_radps < 3e-4
    assert abs(stood.bias_radps - 0.004) < 3.0 * stood.bias_std_radps
    moved = watched(std_radps=0.002, bias_radps=0.004, seconds=2.0)
    assert moved.bias_radps == 0.0
    assert moved.bias_std_radps >= 0.01


def test_what_was_learnt_before_the_heading_was_known_is_used() -> None:
    """Three seconds at rest, then straight on: rough positions say nothing of a bias."""
    random = np.random.default_rng(3)
    track = MotionTrack(info())
    found = []
    for at_ms in range(0, 9000, 10):
        time_s = at_ms / 1000.0
        speed = min(max(2.0 * (time_s - 3.0), 0.0), 8.0)
        driven = 0.25 * speed * speed if speed < 8.0 else 16.0 + 8.0 * (time_s - 7.0)
        rate = (0.0, 0.0, 0.003 + random.normal(0.0, 0.002))
        imu = ImuSample(stamp_ns=at_ms * MS, accel_mps2=(0.0, 0.0, 9.8), rate_radps=rate)
        track.take("imu", imu)
        track.take("speed", SpeedSample(stamp_ns=at_ms * MS, speed_mps=speed))
        if at_ms % 1000 == 0:
            track.take(*fix(time_s, driven, 0.0, std_m=3.0))
        if track.started:
            found.append(track.gyro_bias_radps)
    assert len(found) > 50
    assert np.abs(np.array(found) - 0.003).max() < 6e-4


@given(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), st.floats(0.01, 5.0), st.booleans())
def test_a_held_yaw_stays_as_it_is_and_as_unsure(
    x_m: float, y_m: float, std_m: float, wander: bool
) -> None:
    filter_ = KinematicFilter(xy_m=np.zeros(2), yaw_rad=0.3, speed_mps=8.0, yaw_std_rad=0.1)
    filter_.expect_wander(1.0)
    filter_.predict(2.0)
    correct_gyro(filter_, 0.05, 0.005)
    yaw, before = filter_.mean[YAW], filter_.covariance.copy()
    innovation = filter_.position_innovation(
        filter_.mean[:2] + np.array([x_m, y_m]), (1.0, 0.0), wander=wander
    )
    filter_.correct_position(innovation, std_m, hold_yaw=True)
    assert filter_.mean[YAW] == yaw
    assert filter_.covariance[YAW, YAW] == pytest.approx(before[YAW, YAW], rel=1e-9)
    assert filter_.covariance[X, X] < before[X, X]
    assert np.linalg.eigvalsh(filter_.covariance).min() > -1e-9
