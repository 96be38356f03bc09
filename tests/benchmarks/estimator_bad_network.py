"""What the estimator costs with four channels at 100 Hz through a bad network."""

from __future__ import annotations

from typing import Any

from foretwin.contracts.drive import ImuSample, SpeedSample, SteeringSample
from foretwin.telemetry.estimator.estimator import StateEstimator
from tests.benchmarks.measuring import Measurement, cpu_minimum_s
from tests.telemetry.impaired import BAD, ForeignClock, impaired
from tests.telemetry.position_track import circle, fix, info

DRIVE_S = 10.0
SHARE_OF_A_CORE = 0.1
"""No more may go into knowing where the car is."""


def measure() -> Measurement:
    """Return CPU seconds for one second of a drive on a circle, against a tenth of a core."""
    samples: list[tuple[str, Any]] = []
    for k in range(round(DRIVE_S * 100)):
        stamp_ns = k * 10_000_000
        samples += [
            ("imu", ImuSample(
                stamp_ns=stamp_ns, accel_mps2=(0.0, 2.4, 9.8), rate_radps=(0.0, 0.0, 0.4)
            )),
            ("speed", SpeedSample(stamp_ns=stamp_ns, speed_mps=6.0)),
            ("steering", SteeringSample(stamp_ns=stamp_ns, tire_angle_rad=0.178)),
            fix(k / 100, *circle(k / 100), std_m=0.02),
        ]  # fmt: skip
    arrivals = impaired(samples, BAD, clock=ForeignClock(1.0, 50.0))

    def listen() -> None:
        estimator = StateEstimator(info())
        for channel, message, received_ns in arrivals:
            estimator.handle(channel, message, received_ns=received_ns)

    cost_s = cpu_minimum_s(listen, repeats=3) / DRIVE_S
    more = {"us_per_sample": cost_s * DRIVE_S / len(arrivals) * 1e6}
    return Measurement(cost_s, "CPU s per s", SHARE_OF_A_CORE, more)
