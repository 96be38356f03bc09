"""When a stretch of bends says that steering or tyres have changed, and when it must not."""

from __future__ import annotations

import functools
import math

import msgspec
import numpy as np
import pytest

from foretwin.sim_worker.analysis.identify.regression import smoothed
from foretwin.sim_worker.analysis.identify.steering import fit_steering
from foretwin.sim_worker.analysis.identify.steering_signals import Theta, steering_signals
from foretwin.sim_worker.analysis.identify.step import BendsBefore, Step, bends_before, find_step
from foretwin.sim_worker.analysis.motion_record import MotionRecord
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.telemetry.standin.car import STEP_S, MultiBodyCar
from foretwin.telemetry.standin.parameters import read_parameters
from tests.sim_worker.standin_drives import PERIOD_S, city_minute

PARAMETERS = read_parameters()
CAR = PARAMETERS.car
VEHICLE = load_vehicle()


def driven(
    speed_mps: float,
    *,
    until_s: float,
    accel_mps2: float,
    lateral_mps2: float = 0.0,
    period_s: float = 4.0,
    tyre_rad: float | None = None,
    compliance: float = 0.0,
    seed: int = 0,
) -> MotionRecord:
    """Return what the stand-in's sensors tell of weaving with `lateral_mps2`, or of a circle.

    `accel_mps2` is demanded and `compliance` a steering column that gives, rad per m/s².
    """
    given = msgspec.structs.replace(CAR, steering_compliance_rad_per_mps2=compliance)
    car = MultiBodyCar(given, x_m=0.0, y_m=0.0, yaw_rad=0.0, speed_mps=speed_mps)
    rows = []
    for tick in range(round(until_s / STEP_S)):
        motion = car.motion()
        rows.append(motion)
        wanted = tyre_rad
        if wanted is None:
            wave = math.sin(2.0 * math.pi * tick * STEP_S / period_s)
            wanted = lateral_mps2 * wave * car.wheelbase_m / motion.vx_mps**2
        wheel = (wanted - CAR.steering_offset_rad) * CAR.steering_ratio
        car.step(accel_mps2=accel_mps2, steering_wheel_rad=wheel)
    told = {
        name: np.array([getattr(row, name) for row in rows[:: round(PERIOD_S / STEP_S)]])
        for name in ("x_m", "y_m", "vx_mps", "yaw_rate_radps", "accel_x_mps2", "steered_rad")
    }
    count, random, sensors = len(told["x_m"]), np.random.default_rng(seed), PARAMETERS.sensors
    wheel = (told["steered_rad"] - CAR.steering_offset_rad) * CAR.steering_ratio
    absent = np.full(count, np.nan)
    return MotionRecord(
        stamp_ns=np.round(np.arange(count) * PERIOD_S * 1e9).astype(np.int64),
        x_m=told["x_m"],
        y_m=told["y_m"],
        altitude_m=np.zeros(count),
        yaw_rad=absent,
        speed_mps=told["vx_mps"] + random.normal(0.0, sensors.speed_std_mps, count),
        yaw_rate_radps=told["yaw_rate_radps"]
        + sensors.gyro_bias_radps
        + random.normal(0.0, sensors.gyro_std_radps, count),
        accel_x_mps2=told["accel_x_mps2"],
        wheel_rad=wheel + random.normal(0.0, sensors.steering_wheel_std_rad, count),
        tire_rad=absent,
        command_accel_mps2=np.full(count, accel_mps2),
        command_wheel_rad=wheel,
        command_tire_rad=absent,
        command_age_s=np.zeros(count),
        manual=np.zeros(count, dtype=np.bool_),
    )


def then(first: MotionRecord, second: MotionRecord) -> MotionRecord:
    """Return one record of two drives, the second begun as the first ended."""
    joined = {
        name: np.concatenate([getattr(first, name), getattr(second, name)])
        for name in MotionRecord._fields
    }
    later_ns = first.stamp_ns[-1] + round(PERIOD_S * 1e9) - second.stamp_ns[0]
    joined["stamp_ns"] = np.concatenate([first.stamp_ns, second.stamp_ns + later_ns])
    return MotionRecord(**joined)


@functools.cache
def town_and_motorway() -> BendsBefore:
    """Return what a minute in town and 20 s of a fast road at one speed tell of the car."""
    cruise = driven(27.0, until_s=20.0, accel_mps2=0.3, lateral_mps2=1.5, seed=5)
    known = bends_before(fit_steering(then(city_minute(), cruise), VEHICLE))
    assert known is not None
    return known


def step_in(record: MotionRecord, known: BendsBefore) -> Step | None:
    return find_step(steering_signals(record, VEHICLE), known)


@pytest.mark.parametrize("until_s", [4.0, 6.0, 8.0])
def test_a_car_that_brakes_from_high_speed_has_not_changed(until_s: float) -> None:
    braked = driven(28.0, until_s=until_s, accel_mps2=-2.0, lateral_mps2=1.5)
    assert step_in(braked, town_and_motorway()) is None


@pytest.mark.parametrize("speed_mps", [14.0, 20.0])
def test_softer_front_tyres_are_found_at_speed(speed_mps: float) -> None:
    softer = driven(
        speed_mps,
        until_s=8.0,
        accel_mps2=0.25,
        lateral_mps2=1.5,
        period_s=10.0,
        compliance=0.003,
    )
    found = step_in(softer, town_and_motorway())
    assert found is not None
    assert found.sure
    assert found.parameter == Theta.UNDERSTEER
    assert 0.001 < found.after - found.before < 0.004


def test_wheels_at_full_lock_tell_neither_of_another_ratio_nor_of_a_change() -> None:
    """Both front wheels of the stand-in stand alike: at lock they turn it 8 % less than one."""
    town, circle = city_minute(), driven(2.2, until_s=12.0, accel_mps2=0.17, tyre_rad=0.55)
    lock = then(town, circle)
    known = bends_before(fit_steering(town, VEHICLE))
    assert known is not None
    assert step_in(lock, known) is None
    value, low, high = fit_steering(lock, VEHICLE).ratio()
    assert low < CAR.steering_ratio < high
    assert value == pytest.approx(CAR.steering_ratio, rel=0.005)


def test_softer_tyres_on_both_axles_show_where_bends_begin_and_end() -> None:
    """The steering wheel turns further while the car's rotation gains or loses, and no further."""
    record = city_minute()
    before = bends_before(fit_steering(record, VEHICLE))
    assert before is not None
    period_s = float(record.time_s[1])
    gaining = smoothed(record.yaw_rate_radps, period_s=period_s, width_s=0.05, derivative=True)
    softer = record.wheel_rad + CAR.steering_ratio * 0.006 * np.nan_to_num(gaining)
    other = step_in(record._replace(wheel_rad=softer), before)
    assert step_in(record, before) is None
    assert other is not None
    assert other.parameter == Theta.TURNING
    assert other.after - other.before == pytest.approx(0.006, rel=0.3)
