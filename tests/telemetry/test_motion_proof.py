"""The proof itself: what is wrong by a unit, a sign or a clock does not pass it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np
import pytest

from foretwin.contracts import drive
from foretwin.contracts.frames import GeoPoint, LocalFrame, geo_from_local
from foretwin.telemetry.logs.log import Log, Sample
from foretwin.telemetry.logs.merge import stamp_ns_of
from tests.telemetry.motion_proof import MotionProof

TIME_S = np.arange(0.0, 120.0, 0.1)
SPEED_MPS = 10.0 + 3.0 * np.sin(0.3 * TIME_S)
RATE_RADPS = 0.2 * np.sin(0.17 * TIME_S)


def weaving(
    *,
    speed: Callable[[float], float] = float,
    rate: Callable[[float], float] = float,
    late_ns: int = 0,
) -> MotionProof:
    """A drive in curves; `speed` and `rate` are what goes wrong on the way into the log."""
    yaw = np.cumsum(RATE_RADPS) * 0.1
    xy = np.cumsum(np.stack([np.cos(yaw), np.sin(yaw)], axis=1) * SPEED_MPS[:, None] * 0.1, axis=0)
    geo = geo_from_local(LocalFrame(GeoPoint(52.5, 13.4)), xy)
    change = np.gradient(SPEED_MPS, TIME_S)

    def read() -> Iterator[Sample]:
        for n, stamp_ns in enumerate((TIME_S * 1e9).astype(int).tolist()):
            stamp_ns += 10**9
            yield "gnss", drive.GnssFix(stamp_ns=stamp_ns, position=GeoPoint(*geo[n].tolist()))
            told = drive.SpeedSample(stamp_ns=stamp_ns + late_ns, speed_mps=speed(SPEED_MPS[n]))
            yield "speed", told
            yield (
                "imu",
                drive.ImuSample(
                    stamp_ns=stamp_ns,
                    accel_mps2=(float(change[n]), 0.0, 9.8),
                    rate_radps=(0.0, 0.0, rate(RATE_RADPS[n])),
                ),
            )
            heading = drive.HeadingSample(stamp_ns=stamp_ns, yaw_rad=float(yaw[n]) + 0.1)
            yield "heading", heading
            tire = math.atan(2.7 * RATE_RADPS[n] / SPEED_MPS[n])
            yield "steering", drive.SteeringSample(stamp_ns=stamp_ns, tire_angle_rad=tire)

    info = drive.VehicleInfo(vehicle_id="car", time_base="log", start_stamp_ns=10**9)
    return MotionProof(Log(info=info, read=lambda _: iter(sorted(read(), key=stamp_ns_of))))


def test_what_is_right_is_proved() -> None:
    shown = weaving()
    for proof in (
        shown.of_speed(),
        shown.of_yaw_rate(),
        shown.of_heading(),
        shown.of_acceleration(),
    ):
        assert proof.correlation > 0.99
        assert proof.slope == pytest.approx(1.0, abs=0.03)
        assert abs(proof.lag_s) < 0.11
    assert shown.heading_offset_deg() == pytest.approx(math.degrees(0.1), abs=0.7)
    assert shown.of_steering("tire_angle_rad").slope == pytest.approx(2.7, rel=0.05)


def test_a_wrong_unit_sign_or_clock_shows() -> None:
    assert weaving(speed=lambda v: 3.6 * v).of_speed().slope == pytest.approx(3.6, abs=0.1)
    assert weaving(rate=lambda r: -r).of_yaw_rate().correlation < -0.99
    assert weaving(rate=math.degrees).of_yaw_rate().slope == pytest.approx(57.3, abs=2.0)
    assert weaving(late_ns=400_000_000).of_speed().lag_s == pytest.approx(0.4, abs=0.06)
