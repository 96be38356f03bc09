"""Two minutes of turns to both sides, measured by a gyro that may be wrong."""

from __future__ import annotations

import math

from foretwin.contracts.drive import HeadingSample, ImuSample, SpeedSample, VehicleState
from foretwin.telemetry.estimator.estimator import StateEstimator
from tests.telemetry.position_track import fix, info

TICK_S = 0.02
TICKS = 6000


def winding() -> list[tuple[float, float, float, float, float]]:
    """Speed, yaw rate, heading and place (2) at 50 Hz."""
    heading = x = y = 0.0
    found = []
    for tick in range(TICKS):
        speed, rate = 6.0 + 4.0 * math.sin(tick / 500.0), 0.3 * math.sin(tick / 160.0)
        heading += TICK_S * rate
        x, y = x + TICK_S * speed * math.cos(heading), y + TICK_S * speed * math.sin(heading)
        found.append((speed, rate, heading, x, y))
    return found


WINDING = winding()


def driven(
    gain: float, *, right_from_s: float = math.inf, **sensors: bool
) -> tuple[StateEstimator, list[tuple[int, VehicleState]]]:
    """Drive with a gyro that shows `gain` times the turning until it is mended."""
    estimator, states = StateEstimator(info()), []
    for tick, (speed, rate, heading, x, y) in enumerate(WINDING):
        time_s = tick * TICK_S
        stamp_ns = round(time_s * 1e9)
        told = rate if time_s >= right_from_s else gain * rate
        imu = ImuSample(stamp_ns=stamp_ns, accel_mps2=(0.0, 0.0, 9.8), rate_radps=(0.0, 0.0, told))
        estimator.handle("imu", imu)
        if sensors.get("headings"):
            yaw_rad = math.remainder(heading, math.tau)
            estimator.handle("heading", HeadingSample(stamp_ns=stamp_ns, yaw_rad=yaw_rad))
        if sensors.get("wheels"):
            estimator.handle("speed", SpeedSample(stamp_ns=stamp_ns, speed_mps=speed))
        if tick % 5 == 0:
            state = estimator.handle(*fix(time_s, x, y, 0.02))
            if state is not None:
                states.append((tick, state))
    return estimator, states
