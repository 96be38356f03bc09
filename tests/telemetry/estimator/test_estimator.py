"""The estimator on clean input: what it makes of positions alone, and of every sensor."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from foretwin.contracts.drive import HeadingSample, SpeedSample
from foretwin.contracts.frames import wrap_angle
from tests.telemetry.position_track import (
    Sample,
    along,
    circle,
    fix,
    info,
    states_of,
    xy,
    yaw,
)
from tests.telemetry.standin_drive import whole_drive

COVERS = (
    "foretwin.telemetry.estimator.motion_track",
    "foretwin.telemetry.estimator.reported_state",
)


def test_positions_alone_give_the_motion_on_a_circle() -> None:
    states = states_of(along(circle, 12.0))
    for state in states[20:]:
        assert state.speed_mps == pytest.approx(6.0, abs=0.05)
        assert state.yaw_rate_radps == pytest.approx(0.4, abs=0.02)
        expected = wrap_angle(0.4 * state.stamp_ns * 1e-9)
        assert abs(wrap_angle(yaw(state) - expected)) < 0.02
    assert states[-1].tire_angle_rad == pytest.approx(math.atan(2.7 / 15.0), abs=0.01)
    assert set(states[-1].estimated) == {
        "yaw_rad",
        "speed_mps",
        "yaw_rate_radps",
        "accel_mps2",
        "tire_angle_rad",
    }


def test_a_position_without_stated_noise_leaves_as_it_came() -> None:
    samples = along(circle, 5.0)
    for (_, message), state in zip(samples, states_of(samples), strict=True):
        assert state.position == message.position
        assert state.stamp_ns == message.stamp_ns


@settings(max_examples=25, deadline=None)
@given(
    forward=st.floats(-2.0, 3.0),
    left=st.floats(-1.0, 1.0),
    heading=st.floats(-math.pi, math.pi),
)
def test_the_antenna_is_taken_back_to_the_rear_axle(
    forward: float, left: float, heading: float
) -> None:
    cos, sin = math.cos(heading), math.sin(heading)

    def antenna(time_s: float) -> tuple[float, float]:
        distance = 8.0 * time_s
        return cos * (distance + forward) - sin * left, sin * (distance + forward) + cos * left

    samples = along(antenna, 6.0)
    state = states_of(samples, info=info(body_from_antenna_m=(forward, left, 1.5)))[-1]
    distance = 8.0 * state.stamp_ns * 1e-9
    assert xy(state) == pytest.approx([cos * distance, sin * distance], abs=0.01)
    assert abs(wrap_angle(yaw(state) - heading)) < 1e-3


def stop_and_go(time_s: float) -> tuple[float, float]:
    """Brake from 8 m/s to rest at 16 m, stand from 4 to 12 s, leave again at 1.5 m/s²."""
    if time_s < 4.0:
        return 8.0 * time_s - time_s**2, 0.0
    return 16.0 + (0.75 * (time_s - 12.0) ** 2 if time_s > 12.0 else 0.0), 0.0


def test_a_standing_car_does_not_turn_with_its_jitter() -> None:
    jitter = np.random.default_rng(3).normal(0.0, 0.005, (200, 2))
    samples = [fix(k / 5, stop_and_go(k / 5)[0] + jitter[k, 0], jitter[k, 1]) for k in range(80)]
    states = states_of(samples)
    standing = [state for state in states if 5.5e9 < state.stamp_ns < 12.0e9]
    assert max(abs(yaw(state)) for state in standing) < 0.02
    assert np.ptp([yaw(state) for state in standing]) < 2e-3
    assert max(state.speed_mps for state in standing) < 0.05
    assert all(state.yaw_valid for state in standing)
    assert states[-1].speed_mps == pytest.approx(1.5 * 3.8, abs=0.15)


def test_the_heading_is_unknown_until_the_car_has_moved() -> None:
    jitter = np.random.default_rng(4).normal(0.0, 0.005, (30, 2))
    standing = [fix(k / 5, *jitter[k]) for k in range(30)]
    assert not any(state.yaw_valid for state in states_of(standing))
    moving = [fix(6.0 + k / 5, 0.0, 0.8 * k) for k in range(10)]
    state = states_of(standing + moving)[-1]
    assert state.yaw_valid
    assert yaw(state) == pytest.approx(math.pi / 2, abs=0.05)


def test_cutting_the_input_changes_nothing_before() -> None:
    samples = whole_drive().samples[:4000]
    cut = 3000
    vehicle = whole_drive().source.info
    whole = states_of(samples, info=vehicle)
    part = states_of(samples[:cut], info=vehicle)
    assert part == whole[: len(part)]
    assert len(part) > 450


def test_all_sensors_of_the_stand_in_are_fused_close_to_its_truth() -> None:
    source, samples = whole_drive()
    states = states_of(samples, info=source.info, steering=source.steering)
    valid = [state for state in states if state.yaw_valid]
    truth = [source.truth(state.stamp_ns) for state in valid]
    pairs = list(zip(valid, truth, strict=True))
    position = [math.hypot(*(xy(a) - xy(b))) for a, b in pairs]
    heading = [abs(float(wrap_angle(a.yaw_rad - b.yaw_rad))) for a, b in pairs]
    speed = [a.speed_mps - b.speed_mps for a, b in pairs]
    yaw_rate = [a.yaw_rate_radps - b.yaw_rate_radps for a, b in pairs]
    assert np.percentile(position, 95) < 0.04
    assert np.degrees(np.percentile(heading, 95)) < 1.0
    assert np.sqrt(np.mean(np.square(speed))) < 0.05
    assert np.sqrt(np.mean(np.square(yaw_rate))) < 0.01
    assert valid[-1].estimated == ("yaw_rad",)


def test_states_between_positions_come_every_20_ms_at_most() -> None:
    samples: list[Sample] = []
    for k in range(300):
        time_s = k * 0.01
        speed = SpeedSample(stamp_ns=round(time_s * 1e9), speed_mps=5.0)
        samples.append(("speed", speed))
        if k % 20 == 0:
            samples.append(fix(time_s, 5.0 * time_s, 0.0))
    moving = [state for state in states_of(samples) if state.stamp_ns > 1e9]
    gaps = np.diff([state.stamp_ns for state in moving])
    assert gaps.max() == 20_000_000
    for state in moving:
        assert xy(state)[0] == pytest.approx(5.0 * state.stamp_ns * 1e-9, abs=0.05)
        assert "speed_mps" not in state.estimated


def test_reverse_needs_a_negative_measured_speed() -> None:
    samples: list[Sample] = []
    for k in range(100):
        time_s = k * 0.1
        stamp = round(time_s * 1e9)
        samples.append(("heading", HeadingSample(stamp_ns=stamp, yaw_rad=0.0)))
        samples.append(("speed", SpeedSample(stamp_ns=stamp, speed_mps=-2.0)))
        samples.append(fix(time_s, -2.0 * time_s, 0.0))
    state = states_of(samples)[-1]
    assert state.speed_mps == pytest.approx(-2.0, abs=0.1)
    assert abs(yaw(state)) < 0.02
    positions_alone = [sample for sample in samples if sample[0] == "gnss"]
    forward = states_of(positions_alone)[-1]
    assert forward.speed_mps == pytest.approx(2.0, abs=0.1)
    assert abs(abs(yaw(forward)) - math.pi) < 0.02


def test_rough_positions_without_stated_noise_are_smoothed() -> None:
    noise = np.random.default_rng(5).normal(0.0, 1.5, (150, 2))
    rough = [fix(k / 5, 2.0 * k + noise[k, 0], noise[k, 1]) for k in range(150)]
    late = [state for state in states_of(rough) if state.stamp_ns > 15e9]
    truth = np.array([[10.0 * state.stamp_ns * 1e-9, 0.0] for state in late])
    error = np.array([xy(state) for state in late]) - truth
    assert np.sqrt(np.mean(error**2)) < 1.2
    assert np.abs([yaw(state) for state in late]).max() < 0.5
