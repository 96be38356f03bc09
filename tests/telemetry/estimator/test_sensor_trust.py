"""A sensor that tells of another motion than positions is left out, whatever it is wrong in."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from foretwin.contracts.drive import HeadingSample, ImuSample, SpeedSample, SteeringSample
from foretwin.telemetry.estimator.sensor_trust import LEFT_OUT, SensorTrust
from tests.telemetry.winding_drive import (
    BRISK,
    TICK_S,
    TICKS,
    WINDING,
    Told,
    driven,
    measured,
    truly,
)
from tests.telemetry.wrong_sensor_figures import CHANNEL, PRECISE, ROUGH, WRONG, errors, way_for

SORTED_OUT_S = 24.0
"""Within which a wrong sensor is left out, for good."""
NOISE = np.random.default_rng(7).normal(0.0, 1.0, (TICKS, 2))


@pytest.mark.parametrize(
    "fixes",
    [
        pytest.param(PRECISE, id="precise"),
        pytest.param(ROUGH, id="rough", marks=pytest.mark.judge),
    ],
)
@pytest.mark.parametrize("wrong", WRONG)
def test_a_wrong_sensor_does_not_lead_the_car(wrong: str, fixes: dict[str, Any]) -> None:
    name, told = WRONG[wrong]
    sensors = {"gyro": truly, "wheels": truly, "heading": truly} | {name: told}
    end_s = 120.0 if fixes is ROUGH else 60.0
    estimator, states = driven(**sensors, **fixes, way=way_for(name), end_s=end_s)
    field, reason = LEFT_OUT[CHANNEL[name]]
    assert estimator.skipped[reason] > (end_s - SORTED_OUT_S) / TICK_S
    assert field in states[-1][1].estimated
    speed_mps, yaw_rad = errors(states, from_s=30.0, way=way_for(name))
    assert speed_mps < (1.7 if name == "wheels" else 0.2)
    assert yaw_rad < math.radians(10.0)


@pytest.mark.parametrize("fixes", [PRECISE, ROUGH], ids=["precise", "rough"])
def test_what_goes_with_positions_is_used(fixes: dict[str, Any]) -> None:
    every = {"gyro": truly, "wheels": truly, "heading": truly, "steering": truly}
    estimator, states = driven(**every, **fixes, end_s=120.0 if fixes is ROUGH else 60.0)
    assert estimator.left_out == frozenset()
    assert not any(estimator.skipped[reason] for _, reason in LEFT_OUT.values())
    speed_mps, yaw_rad = errors(states, from_s=10.0)
    assert speed_mps < 0.2
    assert yaw_rad < math.radians(1.0)


@pytest.mark.parametrize("wrong", ["a gyro upside down", "wheels in km/h", "headings to the rear"])
def test_a_sensor_that_has_come_right_is_believed_again(wrong: str) -> None:
    name, told = WRONG[wrong]
    estimator, states = driven(**{"wheels": truly} | {name: told}, right_from_s=40.0, end_s=80.0)
    assert estimator.left_out == frozenset()
    field, reason = LEFT_OUT[CHANNEL[name]]
    assert estimator.skipped[reason] > 0.2 * TICKS
    assert field not in states[-1][1].estimated


def fed(trust: SensorTrust, *, wheels: Told, ticks: range = range(TICKS), **fixes: float) -> None:
    """Let fixes come `late_s`, of an antenna `ahead_m` of the axle, with white noise `noise_m`."""
    late, ahead_m = round(fixes.get("late_s", 0.0) / TICK_S), fixes.get("ahead_m", 0.0)
    gain, bias_radps = fixes.get("gain", 1.0), fixes.get("bias_radps", 0.0)
    sensors = {"wheels": wheels, "heading": truly, "steering": truly}
    for tick in ticks:
        stamp_ns, curvature_pm = round(tick * TICK_S * 1e9), WINDING[tick][1] / WINDING[tick][0]
        for _, message in measured(tick, gyro=lambda rate: gain * rate + bias_radps, **sensors):
            trust.take(message, gyro_bias_radps=0.0, curvature_pm=curvature_pm)
        if tick % 10 == 0 and tick >= late:
            _, _, yaw_rad, x, y = WINDING[tick - late]
            there = np.array([x + ahead_m * math.cos(yaw_rad), y + ahead_m * math.sin(yaw_rad)])
            std_m = max(fixes.get("noise_m", 0.0), 0.02)
            trust.take_fix(stamp_ns, there + std_m * NOISE[tick], std_m, convergence_rad=0.0)


@given(
    gain=st.floats(0.7, 1.3),
    bias_radps=st.floats(-0.02, 0.02),
    late_s=st.floats(0.0, 2.0),
    ahead_m=st.floats(-1.0, 4.0),
    noise_m=st.floats(0.0, 1.0),
)
@settings(max_examples=25)
def test_honest_sensors_are_believed_whatever_fixes_are_like(**fixes: float) -> None:
    trust = SensorTrust()
    fed(trust, wheels=lambda speed: 1.1 * speed, ticks=range(TICKS // 2), **fixes)
    assert trust.left_out == frozenset()


def test_a_copy_goes_on_by_itself() -> None:
    trust = SensorTrust()
    fed(trust, wheels=truly, ticks=range(100))
    other = trust.copy()
    for tick in range(100, TICKS // 4):
        ticks = range(tick, tick + 1)
        fed(other, wheels=lambda speed: 3.6 * speed, ticks=ticks)
        fed(trust, wheels=truly, ticks=ticks)
    assert (trust.left_out, other.left_out) == (frozenset(), {"speed"})


@pytest.mark.parametrize("convergence_rad", [1.0, -1.0])
def test_headings_are_from_east_and_fixes_in_a_frame_of_their_own(convergence_rad: float) -> None:
    trust = SensorTrust()
    for k in range(100):
        stamp_ns = k * 100_000_000
        told = HeadingSample(stamp_ns=stamp_ns, yaw_rad=-1.0)
        trust.take(told, gyro_bias_radps=0.0, curvature_pm=None)
        place = np.array([1.0 * k, 0.0])
        trust.take_fix(stamp_ns, place, 0.02, convergence_rad=convergence_rad)
    assert ("heading" in trust.left_out) == (convergence_rad < 0.0)


@pytest.mark.parametrize("backs", [True, False])
def test_backwards_a_car_turns_the_other_way_than_it_steers(backs: bool) -> None:
    """A circle of 10 m to the left at 2 m/s, or backwards with the wheels turned to the left."""
    trust, way = SensorTrust(), -1.0 if backs else 1.0
    for k in range(400):
        stamp_ns, angle = k * 100_000_000, way * 0.02 * k
        for message in (
            SpeedSample(stamp_ns=stamp_ns, speed_mps=2.0 * way),
            SteeringSample(stamp_ns=stamp_ns, tire_angle_rad=0.3),
            HeadingSample(stamp_ns=stamp_ns, yaw_rad=math.remainder(angle, math.tau)),
        ):
            trust.take(message, gyro_bias_radps=0.0, curvature_pm=0.1)
        place = 10.0 * np.array([math.sin(angle), 1.0 - math.cos(angle)])
        trust.take_fix(stamp_ns, place, 0.02, convergence_rad=0.0)
    assert trust.left_out == frozenset()


@pytest.mark.parametrize("seed", range(4))
def test_fixes_that_wander_while_the_car_stands_say_nothing_of_its_sensors(seed: int) -> None:
    """Three minutes at a metre a second, whatever they say of themselves."""
    trust, random = SensorTrust(), np.random.default_rng(seed)
    place, course_rad = np.zeros(2), 0.0
    for k in range(1800):
        stamp_ns = k * 100_000_000
        at_rest = {"accel_mps2": (0.0, 0.0, 9.8), "rate_radps": (0.0, 0.0, 0.0)}
        for message in (
            ImuSample(stamp_ns=stamp_ns, **at_rest),
            SpeedSample(stamp_ns=stamp_ns, speed_mps=0.0),
            HeadingSample(stamp_ns=stamp_ns, yaw_rad=1.0),
        ):
            trust.take(message, gyro_bias_radps=0.0, curvature_pm=None)
        course_rad += random.normal(0.0, 0.1)
        place = place + 0.1 * np.array([math.cos(course_rad), math.sin(course_rad)])
        trust.take_fix(stamp_ns, place, 0.02, convergence_rad=0.0)
        assert trust.left_out == frozenset()


def test_a_gyro_alone_tells_of_no_force_and_costs_no_speed() -> None:
    estimator, states = driven(wheels=truly, forces=None, way=BRISK, end_s=60.0)
    assert "accel_mps2" in states[-1][1].estimated
    assert estimator.left_out == frozenset()
    assert errors(states, from_s=10.0, way=BRISK)[0] < 0.2
    _, felt = driven(wheels=truly, way=BRISK, end_s=60.0)
    assert "accel_mps2" not in felt[-1][1].estimated


@pytest.mark.parametrize(("told", "believed"), [(truly, True), (lambda _: 0.0, False)])
def test_fixes_alone_show_whether_forces_are_felt(told: Told, believed: bool) -> None:
    estimator, _ = driven(forces=told, way=BRISK, end_s=60.0)
    assert ("forces" not in estimator.left_out) == believed


def test_forces_that_were_silent_for_a_while_are_not_summed_up_over_it() -> None:
    trust = SensorTrust()
    for tick in range(TICKS):
        for _, message in measured(tick, gyro=truly, wheels=truly, way=BRISK):
            if not isinstance(message, ImuSample) or tick % 400 < 300:
                trust.take(message, gyro_bias_radps=0.0, curvature_pm=None)
        if tick % 10 == 0:
            _, _, _, x, y = BRISK[tick]
            stamp_ns = round(tick * TICK_S * 1e9)
            trust.take_fix(stamp_ns, np.array([x, y]), 0.02, convergence_rad=0.0)
        assert "forces" not in trust.left_out
