from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from contracts.drive import (
    GnssFix,
    HeadingSample,
    ImuSample,
    SpeedSample,
    SteeringSample,
    VehicleInfo,
    VehicleState,
)
from contracts.frames import (
    GeoPoint,
    LocalFrame,
    geo_from_local,
    local_from_geo,
    local_from_geo_yaw,
    wrap_angle,
)
from telemetry.estimator import StateEstimator
from tests.telemetry.standin_drive import whole_drive

FRAME = LocalFrame(GeoPoint(52.51, 13.39, 0.0))
Sample = tuple[str, Any]


def info(**fields: Any) -> VehicleInfo:
    return VehicleInfo(vehicle_id="car", time_base="log", start_stamp_ns=0, **fields)


def fix(time_s: float, x_m: float, y_m: float, std_m: float | None = None) -> Sample:
    lat, lon = geo_from_local(FRAME, np.array([x_m, y_m]))
    position = GeoPoint(float(lat), float(lon))
    return "gnss", GnssFix(stamp_ns=round(time_s * 1e9), position=position, std_m=std_m)


def states_of(samples: Iterable[Sample], **options: Any) -> list[VehicleState]:
    estimator = StateEstimator(options.pop("info", info()), **options)
    states = (estimator.handle(channel, message) for channel, message in samples)
    return [state for state in states if state is not None]


def xy(state: VehicleState) -> np.ndarray:
    return local_from_geo(FRAME, state.position.lat_deg, state.position.lon_deg)


def yaw(state: VehicleState) -> float:
    position = state.position
    return float(local_from_geo_yaw(FRAME, state.yaw_rad, position.lat_deg, position.lon_deg))


def along(
    path: Callable[[float], tuple[float, float]], until_s: float, *, rate_hz: float = 5.0
) -> list[Sample]:
    return [fix(k / rate_hz, *path(k / rate_hz)) for k in range(round(until_s * rate_hz))]


def circle(time_s: float, *, radius_m: float = 15.0, speed_mps: float = 6.0) -> tuple[float, float]:
    angle = speed_mps / radius_m * time_s
    return radius_m * math.sin(angle), radius_m * (1.0 - math.cos(angle))


def test_positions_alone_give_the_motion_on_a_circle() -> None:
    states = states_of(along(circle, 12.0))
    for state in states[20:]:
        assert state.speed_mps == pytest.approx(6.0, abs=0.05)
        assert state.yaw_rate_radps == pytest.approx(0.4, abs=0.02)
        expected = wrap_angle(0.4 * state.stamp_ns * 1e-9)
        assert abs(wrap_angle(yaw(state) - expected)) < 0.02
    assert states[-1].tire_angle_rad == pytest.approx(math.atan(2.7 / 15.0), abs=0.01)
    assert set(states[-1].estimated) == {
        "yaw_rad", "speed_mps", "yaw_rate_radps", "accel_mps2", "tire_angle_rad",
    }  # fmt: skip


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
    assert len(part) > 500


def test_all_sensors_of_the_stand_in_are_fused_close_to_its_truth() -> None:
    source, samples = whole_drive()
    states = states_of(
        samples, info=source.info, wheelbase_m=source.wheelbase_m, steering_ratio=15.3
    )
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


def test_wild_positions_are_skipped_and_counted() -> None:
    samples = along(circle, 10.0)
    nowhere = GnssFix(stamp_ns=2_010_000_000, position=GeoPoint(math.nan, 13.0))
    zero = GnssFix(stamp_ns=3_010_000_000, position=GeoPoint(0.0, 0.0))
    late = GnssFix(stamp_ns=1_000_000_000, position=samples[0][1].position)
    dirty = [
        *samples[:11], ("gnss", nowhere), *samples[11:16], ("gnss", zero),
        *samples[16:20], ("gnss", late), *samples[20:25], fix(4.9, 500.0, 500.0), *samples[25:],
    ]  # fmt: skip
    estimator = StateEstimator(info())
    states = [estimator.handle(channel, message) for channel, message in dirty]
    assert estimator.skipped == {
        "gnss_not_finite": 1, "gnss_zero": 1, "gnss_time_backwards": 1, "gnss_jump": 1,
    }  # fmt: skip
    assert [state for state in states if state] == states_of(samples)


def test_rough_positions_without_stated_noise_are_smoothed() -> None:
    noise = np.random.default_rng(5).normal(0.0, 1.5, (150, 2))
    rough = [fix(k / 5, 2.0 * k + noise[k, 0], noise[k, 1]) for k in range(150)]
    late = [state for state in states_of(rough) if state.stamp_ns > 15e9]
    truth = np.array([[10.0 * state.stamp_ns * 1e-9, 0.0] for state in late])
    error = np.array([xy(state) for state in late]) - truth
    assert np.sqrt(np.mean(error**2)) < 1.2
    assert np.abs([yaw(state) for state in late]).max() < 0.5


def test_a_lasting_jump_is_accepted_after_a_second_with_the_motion_kept() -> None:
    before = [fix(k / 5, 2.0 * k, 0.0) for k in range(25)]
    after = [fix(5.0 + k / 5, 300.0 + 2.0 * k, 200.0) for k in range(25)]
    estimator = StateEstimator(info())
    states = [estimator.handle(*sample) for sample in before + after]
    assert estimator.skipped == {"gnss_jump": 5}
    state = states[30]
    assert state is not None
    assert xy(state) == pytest.approx([310.0, 200.0], abs=1e-3)
    assert state.speed_mps == pytest.approx(10.0, abs=0.1)
    assert abs(yaw(state)) < 0.01


def test_one_stamp_from_the_future_does_not_silence_what_follows() -> None:
    samples = along(circle, 8.0)
    wild = GnssFix(stamp_ns=10**15, position=samples[0][1].position)
    estimator = StateEstimator(info())
    dirty = [*samples[:10], ("gnss", wild), *samples[10:]]
    states = [estimator.handle(*sample) for sample in dirty]
    assert estimator.skipped == {"gnss_time_leap": 1}
    assert [state for state in states if state] == states_of(samples)


def test_broken_samples_beside_positions_change_nothing() -> None:
    clean = along(circle, 6.0)
    nan = math.nan
    broken: list[Sample] = [
        ("speed", SpeedSample(stamp_ns=2_000_000_000, speed_mps=nan)),
        ("imu", ImuSample(stamp_ns=2_000_000_000, accel_mps2=(nan, 0, 9), rate_radps=(0, 0, 1.0))),
        ("heading", HeadingSample(stamp_ns=2_000_000_000, yaw_rad=math.inf)),
        ("steering", SteeringSample(stamp_ns=2_000_000_000, tire_angle_rad=nan)),
        ("status", None),
    ]
    assert states_of(clean[:11] + broken + clean[11:]) == states_of(clean)


def test_a_wrong_beginning_on_the_other_side_of_the_earth_is_forgotten() -> None:
    wrong = GnssFix(stamp_ns=0, position=GeoPoint(-30.0, -160.0))
    samples = [fix(1.0 + k / 5, 2.0 * k, 0.0) for k in range(25)]
    states = states_of([("gnss", wrong), *samples])
    assert states[-1].position == samples[-1][1].position
    assert states[-1].speed_mps == pytest.approx(10.0, abs=0.1)


numbers = st.one_of(st.floats(), st.floats(-100.0, 100.0))
stamps_ns = st.integers(0, 10**11)
positions = st.builds(
    GeoPoint,
    st.one_of(st.floats(), st.floats(52.5, 52.51)),
    st.one_of(st.floats(), st.floats(13.3, 13.31)),
)
messages = st.one_of(
    st.tuples(
        st.just("gnss"),
        st.builds(
            GnssFix,
            stamp_ns=stamps_ns,
            position=positions,
            std_m=st.none() | st.floats(0.0, 10.0),
        ),
    ),
    st.tuples(st.just("speed"), st.builds(SpeedSample, stamp_ns=stamps_ns, speed_mps=numbers)),
    st.tuples(st.just("heading"), st.builds(HeadingSample, stamp_ns=stamps_ns, yaw_rad=numbers)),
    st.tuples(
        st.just("imu"),
        st.builds(
            ImuSample,
            stamp_ns=stamps_ns,
            accel_mps2=st.tuples(numbers, numbers, numbers),
            rate_radps=st.tuples(numbers, numbers, numbers),
        ),
    ),
)


@settings(max_examples=40, deadline=None)
@given(st.lists(messages, max_size=40))
def test_whatever_arrives_no_state_is_broken(samples: list[Sample]) -> None:
    samples = sorted(samples, key=lambda sample: sample[1].stamp_ns)
    stamps = []
    for state in states_of(samples):
        numbers = (state.yaw_rad, state.speed_mps, state.yaw_rate_radps, state.accel_mps2)
        assert all(math.isfinite(number) for number in numbers)
        state.position.validate()
        stamps.append(state.stamp_ns)
    assert stamps == sorted(stamps)
