"""Fixes that no car reaches: held back, and borne out or not by the next one."""

from __future__ import annotations

import math

import numpy as np
import pytest

from foretwin.contracts.drive import HeadingSample, SpeedSample
from foretwin.telemetry.estimator.estimator import StateEstimator
from foretwin.telemetry.estimator.filter_state import GNSS_X, X
from foretwin.telemetry.estimator.innovations import SurpriseCount
from foretwin.telemetry.estimator.kinematic_filter import KinematicFilter
from foretwin.telemetry.estimator.map_aid import MapAid
from foretwin.telemetry.estimator.measured import MotionSamples
from foretwin.telemetry.estimator.position_corrections import PositionCorrections
from foretwin.telemetry.estimator.position_gate import PositionGate
from tests.telemetry.position_track import Sample, along, circle, fix, info, states_of, xy, yaw
from tests.telemetry.winding_drive import TICK_S, WINDING, driven, measured, truly

COVERS = ("foretwin.telemetry.estimator.slow_motion",)
DRIVEN_S = 20.0


def straight(time_s: float) -> tuple[float, float]:
    return 9.0 * time_s, 0.0


def slipped(
    by_m: tuple[float, float], *, from_s: float = 10.0, until_s: float = 99.0
) -> list[Sample]:
    def place(time_s: float) -> tuple[float, float]:
        x, y = circle(time_s)
        off = from_s <= time_s < until_s
        return x + off * by_m[0], y + off * by_m[1]

    return along(place, DRIVEN_S)


@pytest.mark.parametrize("by_m", [(-0.8, 0.0), (0.0, 0.6), (1.2, 0.4), (-0.3, -0.3)])
def test_a_slip_of_the_receiver_moves_the_place_and_leaves_the_motion(
    by_m: tuple[float, float],
) -> None:
    states = states_of(slipped(by_m))
    for state in states[25:]:
        assert state.speed_mps == pytest.approx(6.0, abs=0.5)
        expected = 0.4 * state.stamp_ns * 1e-9
        assert abs(math.remainder(yaw(state) - expected, math.tau)) < 0.1
    last_s = states[-1].stamp_ns * 1e-9
    assert xy(states[-1]) == pytest.approx(np.add(circle(last_s), by_m), abs=0.01)


def test_one_wrong_fix_is_passed_over_and_the_next_leaves_as_it_came() -> None:
    samples = slipped((0.0, 1.5), from_s=10.0, until_s=10.1)
    estimator = StateEstimator(info())
    states = [estimator.handle(*sample) for sample in samples]
    assert estimator.skipped == {"gnss_outlier": 1}
    wrong, after = states[50], states[51]
    assert wrong is not None
    assert after is not None
    assert xy(wrong) == pytest.approx(circle(10.0), abs=0.1)
    assert wrong.position != samples[50][1].position
    assert after.position == samples[51][1].position


def test_a_car_that_really_brakes_hard_is_followed() -> None:
    def braking(time_s: float) -> tuple[float, float]:
        t = max(0.0, min(time_s - 10.0, 12.0 / 9.0))
        return 12.0 * min(time_s, 10.0) + 12.0 * t - 4.5 * t * t, 0.0

    states = {state.stamp_ns: state for state in states_of(along(braking, DRIVEN_S))}
    assert states[10_600_000_000].speed_mps == pytest.approx(12.0 - 9.0 * 0.6, abs=2.0)
    assert states[12_200_000_000].speed_mps == pytest.approx(0.0, abs=0.3)


def test_a_frozen_receiver_does_not_stop_a_car_and_a_stop_is_one() -> None:
    held = [fix(k / 5, *straight(min(k / 5, 10.0) if k < 58 else k / 5)) for k in range(100)]
    estimator = StateEstimator(info())
    states = [estimator.handle(*sample) for sample in held]
    assert estimator.skipped == {"gnss_repeated": 7}
    assert min(state.speed_mps for state in states[20:] if state is not None) > 8.0

    def stopping(time_s: float) -> tuple[float, float]:
        t = max(0.0, min(time_s - 6.0, 4.5))
        return 9.0 * min(time_s, 6.0) + 9.0 * t - t * t, 0.0

    stopped = states_of(along(stopping, DRIVEN_S))
    assert stopped[-1].speed_mps == 0.0
    assert stopped[-1].yaw_valid


def test_a_car_that_backs_out_keeps_its_heading_and_one_that_was_taken_the_wrong_way_turns() -> (
    None
):
    def out_and_back(time_s: float) -> tuple[float, float]:
        braking_s, leaving_s = min(max(time_s - 6.0, 0.0), 2.0), max(time_s - 10.0, 0.0)
        forth_m = 5.0 * min(time_s, 6.0) + 5.0 * braking_s - 1.25 * braking_s**2
        back_m = 0.5 * min(leaving_s, 2.0) ** 2 + 2.0 * max(leaving_s - 2.0, 0.0)
        return forth_m - back_m, 0.0

    backing = states_of(along(out_and_back, 16.0))[-1]
    assert backing.speed_mps == pytest.approx(-2.0, abs=0.2)
    assert abs(yaw(backing)) < 0.1
    gone = states_of(along(out_and_back, 30.0))[-1]
    assert gone.speed_mps == pytest.approx(2.0, abs=0.2)
    assert abs(abs(yaw(gone)) - math.pi) < 0.1


def test_noise_that_is_stated_a_hundred_times_too_small_widens_what_the_state_says() -> None:
    noise = np.random.default_rng(7).normal(0.0, 2.0, (150, 2))
    rough = [fix(k / 5, 2.0 * k + noise[k, 0], noise[k, 1], std_m=0.02) for k in range(150)]
    states = states_of(rough)
    assert states[-1].position_std_m is not None
    assert states[-1].position_std_m > 0.2
    honest = states_of([fix(k / 5, 2.0 * k, 0.0, std_m=0.02) for k in range(150)])
    assert honest[-1].position_std_m is not None
    assert honest[-1].position_std_m < 0.03


@pytest.mark.parametrize("fix_std_m", [0.02, 0.1])
def test_headings_do_not_make_the_speed_worse(fix_std_m: float) -> None:
    """Headings at 50 Hz beside fixes at 10 Hz: neither tells of pedals, as wheels would."""
    rms_mps = []
    for heading in (None, truly):
        _, states = driven(gyro=None, heading=heading, fix_std_m=fix_std_m)
        off_mps = [state.speed_mps - WINDING[tick][0] for tick, state in states if tick > 500]
        rms_mps.append(float(np.sqrt(np.mean(np.square(off_mps)))))
    alone, with_headings = rms_mps
    assert with_headings < 1.25 * alone


def test_a_wheel_that_says_nought_at_speed_does_not_stop_the_car_and_a_stop_does() -> None:
    samples: list[Sample] = []
    for k in range(300):
        says_mps = 0.0 if 140 <= k < 150 else 9.0
        stamp_ns = round(k * 0.05e9)
        samples.append(("speed", SpeedSample(stamp_ns=stamp_ns, speed_mps=says_mps)))
        if k % 4 == 0:
            samples.append(fix(k / 20, *straight(k / 20), std_m=0.02))
    states = [state for state in states_of(samples) if state.stamp_ns > 3e9]
    assert min(state.speed_mps for state in states) > 8.0
    stopped = [
        (
            "speed",
            SpeedSample(stamp_ns=round((15.0 + k * 0.05) * 1e9), speed_mps=max(9.0 - k / 4, 0.0)),
        )
        for k in range(60)
    ]
    assert states_of([*samples, *stopped])[-1].speed_mps == 0.0


@pytest.mark.parametrize("beyond_m", [0.0, 60.0])
def test_a_car_that_would_have_its_receiver_err_as_none_does_is_where_the_receiver_says(
    beyond_m: float,
) -> None:
    """A telephone's car once pulled away along a wrong heading, and stayed 75 m off for 100 s."""
    gate, surprises = PositionGate(), SurpriseCount()
    measured = MotionSamples(skipped=gate.skipped)
    corrections = PositionCorrections(measured, gate, surprises, (0.0, 0.0))
    filter_ = KinematicFilter(
        xy_m=np.array([-beyond_m, 0.0]), yaw_rad=0.0, yaw_std_rad=0.1, speed_mps=10.0
    )
    filter_.expect_wander(8.0)
    filter_.mean[GNSS_X] = beyond_m
    _, rough = fix(1.0, 0.0, 0.0, 8.0)
    gate.judge(1.0, np.zeros(2), None)
    corrections.correct(filter_, rough, np.zeros(2), aid=MapAid(), standing=False)

    assert filter_.mean[X] == pytest.approx(0.0, abs=0.1)
    assert filter_.mean[GNSS_X] == pytest.approx(0.0, abs=0.1)


def test_after_a_hole_the_car_is_where_the_next_fixes_say() -> None:
    """A recorder that stops at 16 m/s and goes on three minutes later, parked 1.4 km away."""
    samples: list[Sample] = []
    for tick in range(40):
        time_s = 0.5 * tick
        samples.append(("speed", SpeedSample(stamp_ns=round(time_s * 1e9), speed_mps=16.0)))
        samples.append(fix(time_s, 16.0 * time_s, 0.0, 0.8))
    for tick in range(8):
        time_s = 194.0 + 0.5 * tick
        samples.append(("speed", SpeedSample(stamp_ns=round(time_s * 1e9), speed_mps=0.0)))
        samples.append(fix(time_s, 1700.0, 300.0, 0.8))
    after = [state for state in states_of(samples) if state.stamp_ns > 194.2e9]
    assert len(after) >= 7
    for state in after:
        assert xy(state) == pytest.approx((1700.0, 300.0), abs=3.0)


def around_a_hole(
    *, before_mps: float, after_mps: float, resumes_m: tuple[float, float]
) -> list[Sample]:
    """East at 16 m/s, from 10 s on at another speed, a minute of nothing, and then north."""
    samples: list[Sample] = []
    for tick in range(64):
        time_s = 0.5 * tick + (0.0 if tick < 40 else 60.0)
        speed_mps = 16.0 if time_s < 10.0 else before_mps if tick < 40 else after_mps
        place = 16.0 * min(time_s, 10.0) + before_mps * max(time_s - 10.0, 0.0), 0.0
        if tick >= 40:
            place = resumes_m[0], resumes_m[1] + after_mps * (time_s - 80.0)
        samples.append(("speed", SpeedSample(stamp_ns=round(time_s * 1e9), speed_mps=speed_mps)))
        samples.append(fix(time_s, *place, 0.8))
    return samples


@pytest.mark.parametrize("before_mps", [16.0, 0.0])
def test_after_a_hole_a_car_heads_as_it_is_seen_to_and_not_as_before(before_mps: float) -> None:
    """It was known to head east within 15°, and its place led that way, up to 24 m off."""
    drive = around_a_hole(before_mps=before_mps, after_mps=16.0, resumes_m=(900.0, 300.0))
    states = states_of(drive)
    after = [state for state in states if state.stamp_ns > 80e9]
    assert not after[0].yaw_valid
    assert after[2].yaw_valid
    for state in after:
        assert xy(state)[0] == pytest.approx(900.0, abs=3.0)
        assert not state.yaw_valid or yaw(state) == pytest.approx(0.5 * math.pi, abs=0.1)


def test_who_stood_before_a_hole_and_is_where_it_was_heads_as_before() -> None:
    parked = around_a_hole(before_mps=0.0, after_mps=0.0, resumes_m=(161.0, 0.0))
    after = [state for state in states_of(parked) if state.stamp_ns > 80e9]
    assert len(after) > 20
    for state in after:
        assert state.yaw_valid
        assert yaw(state) == pytest.approx(0.0, abs=0.1)


def test_who_stood_before_a_hole_heads_as_before_where_rough_fixes_are_off_by_their_noise() -> None:
    random, samples = np.random.default_rng(2), list[Sample]()
    for name, one in around_a_hole(before_mps=0.0, after_mps=0.0, resumes_m=(160.0, 0.0)):
        if name != "gnss":
            samples.append((name, one))
            continue
        time_s = one.stamp_ns * 1e-9
        place = random.normal((16.0 * min(time_s, 10.0), 0.0), 15.0)
        samples.append(fix(time_s, *place, 15.0))
    states = states_of(samples)
    assert states[-1].yaw_valid
    assert all(one.yaw_valid for one in states if one.stamp_ns > 15e9)


def test_long_after_a_hole_one_fix_far_off_is_no_other_place() -> None:
    """A parked car that is heard of again, drives off, and 8 s later one fix lies 30 m aside."""
    samples = around_a_hole(before_mps=0.0, after_mps=0.0, resumes_m=(160.0, 0.0))[:86]
    for tick in range(40):
        time_s = 82.0 + 0.5 * tick
        aside_m = 30.0 if tick == 20 else 0.0
        samples.append(("speed", SpeedSample(stamp_ns=round(time_s * 1e9), speed_mps=4.0)))
        samples.append(fix(time_s, 160.0 + 2.0 * tick, aside_m, 0.8))
    after = [state for state in states_of(samples) if state.stamp_ns > 82e9]
    assert len(after) > 30
    assert all(state.yaw_valid for state in after)


def test_fixes_of_a_telephone_network_are_rough_and_no_other_place() -> None:
    """Taken for one, each began the motion anew: off by 137 m in the middle instead of 78."""
    random, samples = np.random.default_rng(1), list[Sample]()
    for tick, (*_, x, y) in enumerate(WINDING):
        if tick % 5 == 0:
            samples += measured(tick, heading=truly, wheels=truly)
        if tick % 250 == 0:
            samples.append(fix(TICK_S * tick, *(random.normal((x, y), 300.0)), 300.0))
    off_m = [
        math.dist(xy(state), WINDING[round(state.stamp_ns * 1e-9 / TICK_S)][3:])
        for state in states_of(samples)
        if state.stamp_ns > 30e9
    ]
    assert np.median(off_m) < 100.0


def test_a_heading_heard_first_after_a_hole_begins_no_motion_where_the_car_was() -> None:
    samples: list[Sample] = []
    for channel, message in around_a_hole(
        before_mps=16.0, after_mps=16.0, resumes_m=(900.0, 300.0)
    ):
        if channel == "speed":
            north = 0.5 * math.pi if message.stamp_ns > 70e9 else 0.0
            samples.append(("heading", HeadingSample(stamp_ns=message.stamp_ns, yaw_rad=north)))
        samples.append((channel, message))
    after = [state for state in states_of(samples) if state.stamp_ns > 70e9]
    assert len(after) > 20
    for state in after:
        assert xy(state)[0] == pytest.approx(900.0, abs=3.0)
