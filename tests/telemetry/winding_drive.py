"""Two minutes of turns to both sides, and what sensors say of them that may be wrong."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np

from foretwin.contracts.drive import (
    HeadingSample,
    ImuSample,
    SpeedSample,
    SteeringSample,
    VehicleState,
)
from foretwin.telemetry.estimator.estimator import StateEstimator
from tests.telemetry.position_track import Sample, fix, info

TICK_S = 0.02
TICKS = 6000
WHEELBASE_M = 2.7
Told = Callable[[float], float]
"""What a sensor makes of the truth."""


def truly(value: float) -> float:
    return value


Way = list[tuple[float, float, float, float, float]]
"""Speed, yaw rate, heading and place (2) at 50 Hz."""


def winding(*, brisk: float = 1.0) -> Way:
    """Turns to both sides, at speeds that change up to 0.4 m/s² times `brisk`."""
    heading = x = y = 0.0
    found = []
    for tick in range(TICKS):
        speed, rate = 6.0 + 4.0 * math.sin(brisk * tick / 500.0), 0.3 * math.sin(tick / 160.0)
        heading += TICK_S * rate
        x, y = x + TICK_S * speed * math.cos(heading), y + TICK_S * speed * math.sin(heading)
        found.append((speed, rate, heading, x, y))
    return found


WINDING, BRISK = winding(), winding(brisk=4.0)


def measured(
    tick: int,
    *,
    gyro: Told | None = None,
    wheels: Told | None = None,
    heading: Told | None = None,
    steering: Told | None = None,
    forces: Told | None = truly,
    way: Way = WINDING,
) -> Iterator[Sample]:
    """Yield what sensors say at a tick, none of those that are None, nor forces without a gyro."""
    speed, rate, yaw, _, _ = way[tick]
    stamp_ns = round(tick * TICK_S * 1e9)
    if gyro is not None:
        felt = (0.0, 0.0, 0.0) if forces is None else (forces(_pushed_mps2(way, tick)), 0.0, 9.8)
        turned = (0.0, 0.0, gyro(rate))
        yield "imu", ImuSample(stamp_ns=stamp_ns, accel_mps2=felt, rate_radps=turned)
    if heading is not None:
        told = math.remainder(heading(yaw), math.tau)
        yield "heading", HeadingSample(stamp_ns=stamp_ns, yaw_rad=told)
    if wheels is not None:
        yield "speed", SpeedSample(stamp_ns=stamp_ns, speed_mps=wheels(speed))
    if steering is not None:
        angle = steering(math.atan(WHEELBASE_M * rate / speed))
        yield "steering", SteeringSample(stamp_ns=stamp_ns, tire_angle_rad=angle)


def _pushed_mps2(way: Way, tick: int) -> float:
    before, after = max(tick - 1, 0), min(tick + 1, TICKS - 1)
    return (way[after][0] - way[before][0]) / ((after - before) * TICK_S)


def driven(
    *,
    gyro: Told | None = truly,
    wheels: Told | None = None,
    heading: Told | None = None,
    steering: Told | None = None,
    forces: Told | None = truly,
    right_from_s: float = math.inf,
    end_s: float = TICKS * TICK_S,
    fix_std_m: float = 0.02,
    fix_every: int = 5,
    way: Way = WINDING,
) -> tuple[StateEstimator, list[tuple[int, VehicleState]]]:
    """Drive with sensors as told, none where None, which are right from a time on.

    Fixes err by `fix_std_m`: by white noise, from half a metre on slowly wandering for the most
    part. Returns the estimator, and the tick and the state of each fix.
    """
    estimator, states = StateEstimator(info()), []
    noise, wander = np.random.default_rng(3).normal(0.0, 1.0, (2, TICKS, 2)), np.zeros(2)
    stays = math.exp(-fix_every * TICK_S / 30.0) if fix_std_m >= 0.5 else 0.0
    told = {"gyro": gyro, "wheels": wheels, "heading": heading, "steering": steering}
    sensors = told | {"forces": forces}
    for tick, (_, _, _, x, y) in enumerate(way[: round(end_s / TICK_S)]):
        time_s = tick * TICK_S
        if time_s >= right_from_s:
            sensors = {name: one and truly for name, one in sensors.items()}
        for sample in measured(tick, way=way, **sensors):
            estimator.handle(*sample)
        if tick % fix_every == 0:
            wander = stays * wander + math.sqrt(1.0 - stays**2) * noise[0, tick]
            off = fix_std_m * (wander + 0.1 * noise[1, tick] if stays else noise[1, tick])
            state = estimator.handle(*fix(time_s, x + off[0], y + off[1], fix_std_m))
            if state is not None:
                states.append((tick, state))
    return estimator, states
