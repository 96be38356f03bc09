from __future__ import annotations

import itertools
import math

import msgspec
import pytest

from foretwin.telemetry.standin.car import STEP_S, CarMotion, MultiBodyCar
from foretwin.telemetry.standin.parameters import read_parameters

COVERS = ("foretwin.telemetry.standin.car",)


def drive(car: MultiBodyCar, duration_s: float, *, accel: float, wheel: float) -> list[CarMotion]:
    motions = []
    for _ in range(round(duration_s / STEP_S)):
        car.step(accel_mps2=accel, steering_wheel_rad=wheel)
        motions.append(car.motion())
    return motions


def parked(**pose: float) -> MultiBodyCar:
    start = {"x_m": 3.0, "y_m": -2.0, "yaw_rad": 2.0} | pose
    return MultiBodyCar(read_parameters().car, **start)


def test_the_car_is_placed_by_its_rear_axle_and_not_by_its_centre_of_gravity() -> None:
    motion = parked().motion()
    assert (motion.x_m, motion.y_m, motion.yaw_rad) == pytest.approx((3.0, -2.0, 2.0))


def test_a_braked_car_stands_still_to_the_last_bit() -> None:
    car = parked()
    before = car.motion()
    after = drive(car, 0.5, accel=-1.0, wheel=0.0)[-1]
    assert (after.x_m, after.y_m, after.vx_mps) == (before.x_m, before.y_m, 0.0)


def test_the_rear_axle_does_not_slide_sideways_at_walking_speed() -> None:
    # The converted point is the rear axle exactly where its sideways speed vanishes when rolling.
    car = parked(speed_mps=1.5)
    motion = drive(car, 2.5, accel=0.0, wheel=3.0)[-1]
    assert motion.vx_mps > 1.0
    assert abs(motion.vy_mps) < 0.01 * motion.vx_mps
    rolling = motion.vx_mps * math.tan(motion.tire_angle_rad) / car.wheelbase_m
    assert motion.yaw_rate_radps == pytest.approx(rolling, rel=0.03)


def test_speed_and_turning_are_continuous_where_rolling_becomes_multi_body_and_back() -> None:
    car = parked(speed_mps=0.6)
    motions = drive(car, 1.2, accel=1.2, wheel=2.0) + drive(car, 1.2, accel=-1.5, wheel=2.0)
    assert max(m.vx_mps for m in motions) > 1.3
    assert motions[-1].vx_mps < 0.7
    for before, after in itertools.pairwise(motions):
        assert abs(after.vx_mps - before.vx_mps) < 0.02
        assert abs(after.yaw_rate_radps - before.yaw_rate_radps) < 0.02
        assert math.hypot(after.x_m - before.x_m, after.y_m - before.y_m) < 0.01


def test_steering_waits_for_its_delay() -> None:
    car = parked(speed_mps=5.0)
    delay_s = read_parameters().car.steering_delay_s
    before = drive(car, delay_s, accel=0.0, wheel=1.0)[-1]
    after = drive(car, 0.1, accel=0.0, wheel=1.0)[-1]
    # Until then the tyre only settles on the hidden offset.
    assert abs(before.tire_angle_rad) <= read_parameters().car.steering_offset_rad
    assert after.tire_angle_rad > 0.02


def test_softer_front_tyres_turn_the_car_less_from_then_on() -> None:
    given = read_parameters().car
    car = MultiBodyCar(given, x_m=0.0, y_m=0.0, yaw_rad=0.0, speed_mps=10.0)
    firm = drive(car, 3.0, accel=0.2, wheel=0.6)[-1]
    softness = 0.003
    car.become(msgspec.structs.replace(given, steering_compliance_rad_per_mps2=softness))
    soft = drive(car, 3.0, accel=0.2, wheel=0.6)[-1]
    assert soft.steered_rad == pytest.approx(firm.steered_rad, abs=1e-4)
    gives = soft.steered_rad - soft.tire_angle_rad
    assert gives == pytest.approx(softness * soft.accel_y_mps2, rel=0.02)
