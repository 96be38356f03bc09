"""The estimator on dirty input: what is impossible is refused, counted and changes nothing."""

from __future__ import annotations

import math
import random

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from foretwin.contracts.drive import GnssFix, HeadingSample, ImuSample, SpeedSample, SteeringSample
from foretwin.contracts.frames import GeoPoint
from foretwin.telemetry.estimator import kinematic_filter
from foretwin.telemetry.estimator.estimator import StateEstimator
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

COVERS = ("foretwin.telemetry.estimator.position_gate",)


def test_wild_positions_are_skipped_and_counted() -> None:
    samples = along(circle, 10.0)
    nowhere = GnssFix(stamp_ns=2_010_000_000, position=GeoPoint(math.nan, 13.0))
    zero = GnssFix(stamp_ns=3_010_000_000, position=GeoPoint(0.0, 0.0))
    late = GnssFix(stamp_ns=1_000_000_000, position=samples[0][1].position)
    dirty = [
        *samples[:11],
        ("gnss", nowhere),
        *samples[11:16],
        ("gnss", zero),
        *samples[16:20],
        ("gnss", late),
        *samples[20:25],
        fix(4.9, 500.0, 500.0),
        *samples[25:],
    ]
    estimator = StateEstimator(info())
    states = [estimator.handle(channel, message) for channel, message in dirty]
    assert estimator.skipped == {
        "gnss_not_finite": 1,
        "gnss_zero": 1,
        "gnss_time_backwards": 1,
        "gnss_jump": 1,
    }
    assert [state for state in states if state] == states_of(samples)


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


def stepped(samples: list[Sample], *, from_s: float, by_s: float) -> list[Sample]:
    """Return the samples with the clock of all after `from_s` set by `by_s`."""
    return [
        (channel, msgspec.structs.replace(message, stamp_ns=message.stamp_ns + round(by_s * 1e9)))
        if message.stamp_ns >= from_s * 1e9
        else (channel, message)
        for channel, message in samples
    ]


def received(estimator: StateEstimator, samples: list[Sample], times: list[Sample]) -> list:
    """Return the states of `samples` when they come at the stamps of `times`."""
    return [
        estimator.handle(*sample, received_ns=time[1].stamp_ns)
        for sample, time in zip(samples, times, strict=True)
    ]


@pytest.mark.parametrize("with_receipt", [False, True])
def test_a_clock_that_jumps_back_is_believed_after_a_second(with_receipt: bool) -> None:
    true = along(circle, 20.0)
    samples = stepped(true, from_s=10.0, by_s=-7200.0)
    estimator = StateEstimator(info())
    if with_receipt:
        states = received(estimator, samples, true)
    else:
        states = [estimator.handle(*sample) for sample in samples]
    assert [k for k, state in enumerate(states) if state is None] == [50, 51, 52, 53, 54]
    assert estimator.skipped.total() == 5
    (step,) = estimator.clock.steps
    assert step.step_ns == pytest.approx(-7200e9, abs=1e6)
    for state, (_, message) in list(zip(states, samples, strict=True))[56:]:
        assert state is not None
        assert state.stamp_ns == message.stamp_ns
        assert xy(state) == pytest.approx(circle(state.stamp_ns * 1e-9 + 7200.0), abs=1e-3)
        assert state.speed_mps == pytest.approx(6.0, abs=0.1)


def test_a_channel_that_changes_its_type_is_counted_and_survived() -> None:
    clean = along(circle, 6.0)
    estimator = StateEstimator(info())
    wrong = [
        ("speed", clean[12][1]),
        ("gnss", SpeedSample(stamp_ns=2_300_000_000, speed_mps=6.0)),
        ("imu", "a text"),
        ("steering", HeadingSample(stamp_ns=2_300_000_000, yaw_rad=3.0)),
    ]
    states = [estimator.handle(*sample) for sample in clean[:12] + wrong + clean[12:]]
    assert estimator.skipped == {
        "speed_wrong_type": 1,
        "gnss_wrong_type": 1,
        "imu_wrong_type": 1,
        "steering_wrong_type": 1,
    }
    assert [state for state in states if state] == states_of(clean)


def test_one_wild_stamp_of_a_sensor_beside_positions_does_not_silence_the_rest() -> None:
    samples: list[Sample] = []
    for k in range(120):
        samples.append(("speed", SpeedSample(stamp_ns=k * 50_000_000, speed_mps=6.0)))
        if k % 4 == 0:
            samples.append(fix(k / 20, 0.3 * k, 0.0))
    wild = ("speed", SpeedSample(stamp_ns=10**15, speed_mps=6.0))
    estimator = StateEstimator(info())
    states = [estimator.handle(*sample) for sample in [*samples[:60], wild, *samples[60:]]]
    assert estimator.skipped == {"speed_time_leap": 1}
    assert [state for state in states if state] == states_of(samples)


def test_jumps_and_broken_numbers_through_a_network_are_counted_and_survived() -> None:
    true = along(circle, 10.0)
    nowhere = GnssFix(stamp_ns=2_410_000_000, position=GeoPoint(math.nan, 13.0))
    samples = [*true[:13], ("gnss", nowhere), fix(2.6, 500.0, 0.0), *true[14:]]
    estimator = StateEstimator(info())
    states = received(estimator, samples, [*true[:13], ("gnss", nowhere), *true[13:]])
    assert estimator.skipped == {"gnss_not_finite": 1, "gnss_jump": 1}
    for state in states:
        if state is not None:
            assert xy(state) == pytest.approx(circle(state.stamp_ns * 1e-9), abs=1e-3)


@settings(max_examples=40, deadline=None)
@given(st.lists(st.tuples(messages, st.integers(0, 2 * 10**9)), max_size=40))
def test_whatever_arrives_whenever_no_state_is_broken(
    arrivals: list[tuple[Sample, int]],
) -> None:
    estimator = StateEstimator(info())
    now_ns = 0
    for (channel, message), pause_ns in arrivals:
        now_ns += pause_ns
        state = estimator.handle(channel, message, received_ns=now_ns)
        if state is not None:
            numbers = (state.yaw_rad, state.speed_mps, state.yaw_rate_radps, state.accel_mps2)
            assert all(math.isfinite(number) for number in numbers)
            state.position.validate()


def test_an_estimate_that_is_no_cars_begins_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kinematic_filter, "MOST_SPEED_MPS", 8.0)
    estimator = StateEstimator(info())
    for tick in range(100):
        estimator.handle("speed", SpeedSample(stamp_ns=tick * 10**8, speed_mps=0.1 * tick))
        estimator.handle(*fix(0.1 * tick, 0.005 * tick * tick, 0.0, 0.02))
    assert estimator.skipped["motion_contradicted"] > 0


@pytest.mark.parametrize(("gain", "noise_radps"), [(math.degrees(1.0), 0.0), (1.0, 0.5)])
@pytest.mark.parametrize("source", ["heading", "imu"])
def test_a_wrong_yaw_rate_leads_no_speed_away(source: str, gain: float, noise_radps: float) -> None:
    """In degrees, or noisy: wheels, headings and fixes say what the car does."""
    drawn, estimator, yaw, x, y = random.Random(3), StateEstimator(info()), 0.0, 0.0, 0.0
    for tick in range(1, 3000):
        speed, rate = 6.0 + 4.0 * math.sin(tick / 500.0), 0.3 * math.sin(tick / 160.0)
        yaw += 0.02 * rate
        x, y = x + 0.02 * speed * math.cos(yaw), y + 0.02 * speed * math.sin(yaw)
        told, stamp_ns = gain * rate + drawn.gauss(0.0, noise_radps), tick * 20_000_000
        heading = HeadingSample(stamp_ns=stamp_ns, yaw_rad=math.remainder(yaw, math.tau))
        if source == "heading":
            heading = msgspec.structs.replace(heading, yaw_rate_radps=told)
        else:
            force, rates = (0.0, 0.0, 9.8), (0.0, 0.0, told)
            imu = ImuSample(stamp_ns=stamp_ns, accel_mps2=force, rate_radps=rates)
            estimator.handle("imu", imu)
        estimator.handle("heading", heading)
        estimator.handle("speed", SpeedSample(stamp_ns=stamp_ns, speed_mps=speed))
        if tick % 5 == 0:
            state = estimator.handle(*fix(stamp_ns * 1e-9, x, y, 0.02))
            if tick > 500:  # it has shown itself
                assert state is not None
                assert state.speed_mps == pytest.approx(speed, abs=0.5)
                assert math.remainder(state.yaw_rad - yaw, math.tau) == pytest.approx(0.0, abs=0.1)
