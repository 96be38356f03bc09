"""What a vehicle has measured lately, and what no road vehicle measures."""

from __future__ import annotations

import math
from collections import Counter

import pytest

from foretwin.contracts.drive import ImuSample, SpeedSample, SteeringSample
from foretwin.telemetry.estimator.measured import MotionSamples

UP = (0.0, 0.0, 9.8)


@pytest.mark.parametrize(
    ("channel", "message", "why"),
    [
        ("speed", SpeedSample(stamp_ns=1, speed_mps=99.0), None),
        ("speed", SpeedSample(stamp_ns=1, speed_mps=-99.0), None),
        ("speed", SpeedSample(stamp_ns=1, speed_mps=101.0), "speed_implausible"),
        ("speed", SpeedSample(stamp_ns=1, speed_mps=-101.0), "speed_implausible"),
        ("speed", SpeedSample(stamp_ns=1, speed_mps=math.nan), "speed_not_finite"),
        ("speed", SpeedSample(stamp_ns=1, speed_mps=-math.inf), "speed_not_finite"),
        ("imu", ImuSample(stamp_ns=1, accel_mps2=UP, rate_radps=(0.0, 0.0, 19.0)), None),
        (
            "imu",
            ImuSample(stamp_ns=1, accel_mps2=UP, rate_radps=(0.0, -21.0, 0.0)),
            "imu_implausible",
        ),
        (
            "imu",
            ImuSample(stamp_ns=1, accel_mps2=(0.0, math.nan, 9.8), rate_radps=UP),
            "imu_not_finite",
        ),
        ("steering", SteeringSample(stamp_ns=1, tire_angle_rad=None), None),
        ("steering", SteeringSample(stamp_ns=1, tire_angle_rad=1.6), "steering_implausible"),
    ],
)
def test_what_is_no_motion_of_a_road_vehicle_is_refused_and_counted(
    channel: str, message: SpeedSample | ImuSample | SteeringSample, why: str | None
) -> None:
    skipped: Counter[str] = Counter()
    samples = MotionSamples(skipped=skipped)
    assert samples.take(channel, message) is (why is None)
    assert skipped == ({} if why is None else {why: 1})
