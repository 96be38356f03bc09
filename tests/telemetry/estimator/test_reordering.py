"""Samples out of order give what they would have given in order."""

from __future__ import annotations

import functools
import pickle
from unittest import mock

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from foretwin.contracts.drive import GnssFix, SpeedSample, VehicleState
from foretwin.telemetry.estimator.estimator import StateEstimator
from foretwin.telemetry.estimator.motion_track import MotionTrack
from foretwin.telemetry.estimator.reordering import WINDOW_NS, Reordering
from tests.telemetry.position_track import Sample, circle, fix, info
from tests.telemetry.winding_drive import measured, truly


@functools.cache
def samples(seconds: float = 4.0) -> list[Sample]:
    """Return speeds at 20 Hz and positions at 5 Hz on a circle."""
    result: list[Sample] = []
    for k in range(round(20 * seconds)):
        result.append(("speed", SpeedSample(stamp_ns=k * 50_000_000, speed_mps=6.0)))
        if k % 4 == 0:
            result.append(fix(k / 20, *circle(k / 20), std_m=0.1))
    return result


@functools.cache
def in_order(seconds: float = 4.0) -> VehicleState:
    """Return the state at the last sample."""
    track = MotionTrack(info())
    for channel, message in samples(seconds):
        track.take(channel, message)
    return track.state(end_ns(seconds))


def end_ns(seconds: float) -> int:
    return round(seconds * 1e9) - 50_000_000


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10_000), st.booleans(), st.just(1.6))
@example(84, True, 4.0)
@example(512, True, 4.0)
def test_the_order_of_arrival_does_not_matter(seed: int, doubled: bool, seconds: float) -> None:
    """Over at least five of the windows in which samples may come late."""
    random = np.random.default_rng(seed)
    given_samples = samples(seconds) * (2 if doubled else 1)
    # Out of order by less than the window, with a sample that follows the last of them.
    delays_ns = random.uniform(0, 0.9 * WINDOW_NS, len(given_samples))
    stamps_ns = np.array([message.stamp_ns for _, message in given_samples])
    reordering = Reordering(MotionTrack(info()))
    for k in np.argsort(stamps_ns + delays_ns, kind="stable"):
        reordering.add(*given_samples[k])
        if random.random() < 0.5:
            reordering.track()
    assert reordering.track().state(end_ns(seconds)) == in_order(seconds)
    assert not reordering.late
    assert reordering.doubled.total() == (len(samples(seconds)) if doubled else 0)


def test_what_is_too_late_is_counted_and_left_out() -> None:
    reordering = Reordering(MotionTrack(info()))
    for channel, message in samples():
        reordering.add(channel, message)
        reordering.track()
    late = GnssFix(stamp_ns=2_000_000_001, position=samples()[1][1].position)
    assert not reordering.add("gnss", late)
    assert reordering.late == {"gnss": 1}
    assert reordering.track().state(end_ns(4.0)) == in_order()


def copies_in(seconds: float, *, late_at: int | None = None) -> int:
    """Return how often a track is copied, one sample coming after the three that follow it."""
    reordering = Reordering(MotionTrack(info()))
    order = list(samples(seconds))
    if late_at is not None:
        order.insert(late_at + 3, order.pop(late_at))
    with mock.patch.object(MotionTrack, "copy", autospec=True, side_effect=MotionTrack.copy) as one:
        for channel, message in order:
            reordering.add(channel, message)
            reordering.track()
    assert reordering.track().state(end_ns(seconds)) == in_order(seconds)
    return one.call_count


def test_where_nothing_comes_late_a_track_is_copied_every_tenth_of_a_second() -> None:
    assert copies_in(4.0) == pytest.approx(4.0 / 0.1, abs=2)


def test_for_some_seconds_after_a_late_sample_it_is_copied_oftener() -> None:
    """The speeds come every 50 ms: each of them has a copy before it."""
    assert copies_in(4.0, late_at=20) == pytest.approx(0.8 / 0.1 + 3.2 / 0.05, abs=4)


def test_later_on_it_is_copied_as_before() -> None:
    few, calm = copies_in(9.0, late_at=20), copies_in(9.0)
    assert few - calm == pytest.approx(5.0 / 0.05 - 5.0 / 0.1, abs=5)


def test_of_an_instant_the_speed_is_taken_first_by_which_a_yaw_rate_tells_a_bend() -> None:
    reordering, taken = Reordering(MotionTrack(info())), []
    for channel, message in reversed(list(measured(0, gyro=truly, wheels=truly, heading=truly))):
        reordering.add(channel, message)
    with mock.patch.object(MotionTrack, "take", lambda _, channel, message: taken.append(channel)):
        reordering.track()
    assert taken == ["speed", "imu", "heading"]


def test_a_flood_between_two_states_stays_bounded() -> None:
    reordering = Reordering(MotionTrack(info()))
    reordering.add(*fix(0.0, 0.0, 0.0))
    flood = 5000
    for k in range(flood):
        reordering.add("speed", SpeedSample(stamp_ns=1 + k, speed_mps=1.0))
    assert reordering.waiting < flood / 2
    assert reordering.track().state(flood).stamp_ns == flood


@given(st.integers(20, 60), st.integers(1, 8))
@example(40, 8)
@settings(max_examples=20)
def test_who_goes_on_from_its_bytes_takes_late_samples_as_well(cut: int, late_by: int) -> None:
    """What is left out of the bytes is computed again."""
    first = Reordering(MotionTrack(info()))
    order = samples()
    order = [*order[: cut - late_by], *order[cut - late_by + 1 :]]
    for channel, message in order[: cut - 1]:
        first.add(channel, message)
        first.track()
    again = pickle.loads(pickle.dumps(first))
    assert len(pickle.dumps(first)) < 0.7 * len(pickle.dumps(first.__dict__))
    for reordering in (first, again):
        reordering.track()  # leaves the first copy as it is, for samples that are as late
        for channel, message in [samples()[cut - late_by], *order[cut - 1 :]]:
            reordering.add(channel, message)
    assert again.track().state(end_ns(4.0)) == first.track().state(end_ns(4.0)) == in_order()


def test_an_estimator_that_goes_on_from_its_bytes_gives_the_same_states() -> None:
    straight_on, resumed = StateEstimator(info()), StateEstimator(info())
    for number, (channel, message) in enumerate(samples()):
        if number % 7 == 0:
            resumed = pickle.loads(pickle.dumps(resumed))
        received_ns = message.stamp_ns + 3_000_000
        first = straight_on.handle(channel, message, received_ns=received_ns)
        assert resumed.handle(channel, message, received_ns=received_ns) == first
    assert straight_on.skipped == resumed.skipped
    before, after = straight_on._track, pickle.loads(pickle.dumps(straight_on))._track
    assert after.state(end_ns(4.0)) == before.state(end_ns(4.0))
