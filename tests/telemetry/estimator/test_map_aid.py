"""Lines of a map correct a rough place across the road, once, and leave a good one alone."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import ImuSample, SpeedSample
from foretwin.contracts.frames import GeoPoint, geo_from_local
from foretwin.telemetry.estimator.estimator import StateEstimator
from foretwin.telemetry.estimator.filter_state import GNSS_X, ROAD_OFFSET, SIZE, X, Y
from foretwin.telemetry.estimator.kinematic_filter import KinematicFilter
from foretwin.telemetry.estimator.local_place import LocalPlace
from foretwin.telemetry.estimator.map_aid import MapAid, RoadLine
from tests.telemetry.position_track import FRAME, Sample, fix, info, xy

PLACE = LocalPlace.around(FRAME.origin)
SPREAD_M = 1.5


def line(x_m: float, y_m: float, *, yaw_rad: float = 0.0, spread_m: float = SPREAD_M) -> RoadLine:
    lat, lon = geo_from_local(FRAME, np.array([x_m, y_m]))
    return RoadLine(GeoPoint(float(lat), float(lon)), yaw_rad, spread_m, math.radians(2.0))


def rough(std_m: float = 3.0, *, at: tuple[float, float] = (0.0, 0.0)) -> KinematicFilter:
    """A filter that knows its heading, and its place to `std_m` on each axis."""
    filter_ = KinematicFilter(
        xy_m=np.array(at), yaw_rad=0.0, speed_mps=10.0, yaw_std_rad=math.radians(1.0)
    )
    filter_.doubt_position(std_m)
    return filter_


def std_of(filter_: KinematicFilter, index: int) -> float:
    return math.sqrt(filter_.covariance[index, index])


def take(aid: MapAid, filter_: KinematicFilter, *lines: RoadLine, std_m: float = 3.0) -> list[bool]:
    return [aid.take(filter_, PLACE, one, receiver_std_m=std_m) for one in lines]


def test_a_line_corrects_across_the_road_and_not_along() -> None:
    filter_, aid = rough(), MapAid()
    take(aid, filter_, line(7.0, 4.0))

    # 4 m away, believed by 3² / (3² + 1.5² + 0.3²).
    assert filter_.mean[:2] == pytest.approx([0.0, 4.0 * 9.0 / 11.34], abs=1e-3)
    assert std_of(filter_, X) == pytest.approx(3.0)
    assert std_of(filter_, Y) == pytest.approx(math.sqrt(9.0 - 81.0 / 11.34), abs=1e-3)
    assert aid.shift_m == pytest.approx((0.0, filter_.mean[1]), abs=1e-6)


@settings(max_examples=15, deadline=None)
@given(st.floats(-3.1, 3.1), st.integers(2, 20))
def test_one_street_says_only_once_where_the_car_is(yaw_rad: float, count: int) -> None:
    """However often it is asked over some metres, no surer than the map can be."""
    ahead = np.array([math.cos(yaw_rad), math.sin(yaw_rad)])
    filter_, aid = rough(), MapAid()
    take(aid, filter_, *(line(*(0.5 * k * ahead), yaw_rad=yaw_rad) for k in range(count)))

    left = np.array([-ahead[1], ahead[0]])
    across_m = math.sqrt(left @ filter_.covariance[:2, :2] @ left)
    assert across_m > 0.85 * 3.0 * SPREAD_M / math.hypot(3.0, SPREAD_M)


def test_the_next_street_says_the_rest() -> None:
    filter_, aid = rough(at=(3.0, 3.0)), MapAid()
    take(aid, filter_, line(0.0, 0.0), line(0.0, 0.0, yaw_rad=math.pi / 2))

    assert np.hypot(*filter_.mean[:2]) < 1.5
    assert max(std_of(filter_, X), std_of(filter_, Y)) < SPREAD_M


def test_a_position_that_is_better_than_the_map_is_left_alone() -> None:
    filter_, aid = rough(0.5), MapAid()
    before = filter_.mean.copy()

    assert take(aid, filter_, line(0.0, 2.0), std_m=0.5) == [False]
    assert len(filter_.mean) == SIZE
    np.testing.assert_array_equal(filter_.mean, before)
    assert aid.shift_m is None


def test_in_a_tunnel_the_map_helps_a_good_receiver_too() -> None:
    """What is left of its last position has become worse than the map."""
    filter_, aid = rough(2.0), MapAid()

    assert take(aid, filter_, line(0.0, 2.0), std_m=0.0) == [True]
    assert std_of(filter_, Y) < SPREAD_M


@pytest.mark.parametrize("away_m", [18.0, 200.0])
def test_a_line_far_off_is_not_believed(away_m: float) -> None:
    filter_, aid = rough(), MapAid()

    assert take(aid, filter_, line(0.0, away_m)) == [False]
    assert filter_.mean[Y] == 0.0


def test_a_line_that_surprises_counts_for_less_than_one_that_does_not() -> None:
    moved = []
    for away_m in (6.0, 12.0):
        filter_, aid = rough(), MapAid()
        take(aid, filter_, line(0.0, away_m))
        moved.append(filter_.mean[Y] / away_m)

    assert moved[1] < 0.75 * moved[0]


def test_a_lane_change_is_taken_for_one() -> None:
    """Wheels and gyro see it: most of it is where the car is now, beside the line."""
    filter_, aid = rough(), MapAid()
    take(aid, filter_, *(line(5.0 * k, 0.0) for k in range(20)))
    filter_.mean[Y] += 3.0
    take(aid, filter_, *(line(100.0 + 5.0 * k, 0.0) for k in range(4)))

    assert filter_.mean[Y] > 2.0
    assert filter_.mean[ROAD_OFFSET] > 0.9


def test_a_place_that_makes_the_receiver_err_as_none_does_is_doubted() -> None:
    filter_, aid = rough(), MapAid()
    filter_.expect_wander(3.0)
    take(aid, filter_, line(0.0, 0.0))
    filter_.mean[GNSS_X] = 11.0
    assert not aid.astray(filter_, receiver_std_m=3.0)
    filter_.mean[GNSS_X] = 13.0
    assert aid.astray(filter_, receiver_std_m=3.0)
    assert take(aid, filter_, line(20.0, 0.0), line(100.0, 0.0), line(250.0, 0.0)) == [False] * 3
    assert take(aid, filter_, line(255.0, 0.0)) == [True]


def street(std_m: float | None, *, seconds: float = 20.0) -> list[Sample]:
    """East at 10 m/s; fixes once a second, 4 m north of the way."""
    samples: list[Sample] = []
    for k in range(round(20 * seconds)):
        stamp_ns = k * 50_000_000
        samples.append(
            (
                "imu",
                ImuSample(
                    stamp_ns=stamp_ns, accel_mps2=(0.0, 0.0, 9.8), rate_radps=(0.0, 0.0, 0.0)
                ),
            )
        )
        samples.append(("speed", SpeedSample(stamp_ns=stamp_ns, speed_mps=10.0)))
        if k % 20 == 0:
            samples.append(fix(k / 20, 0.5 * k, 4.0, std_m))
    return samples


def on_the_map(samples: Iterable[Sample], **options: Any) -> tuple[StateEstimator, Array]:
    """Return where the last state is, told of the street at y = 0 with every position."""
    estimator = StateEstimator(info(), **options)
    last = None
    for channel, message in samples:
        state = estimator.handle(channel, message)
        if state is not None and state.yaw_valid and channel == "gnss":
            estimator.take_line(line(float(xy(state)[0]), 0.0))
        last = state or last
    assert last is not None
    return estimator, xy(last)


def test_a_rough_receiver_is_drawn_to_the_road() -> None:
    _, place = on_the_map(street(3.0))

    assert place[0] == pytest.approx(199.5, abs=1.0)
    assert 0.0 < place[1] < 1.8


@pytest.mark.parametrize("std_m", [None, 0.02, 1.0])
def test_a_receiver_better_than_the_map_or_that_says_nothing_gives_what_it_gave(
    std_m: float | None,
) -> None:
    samples = street(std_m, seconds=8.0)
    _, place = on_the_map(samples)
    alone = StateEstimator(info())
    states = [alone.handle(channel, message) for channel, message in samples]
    last = [state for state in states if state is not None][-1]

    np.testing.assert_array_equal(place, xy(last))
    assert last.map_shift_m is None


def test_states_say_that_the_map_helped_and_by_how_much() -> None:
    estimator, _ = on_the_map(street(3.0))
    state = estimator.handle("gnss", fix(20.0, 200.0, 4.0, 3.0)[1])
    assert state is not None
    assert state.map_shift_m is not None

    assert state.map_shift_m[1] < -2.0
    assert abs(state.map_shift_m[0]) < 0.5
    assert state.position_std_m is not None
    assert 1.0 < state.position_std_m < 3.0


@pytest.mark.parametrize("late", [1, 5])
def test_samples_that_come_after_a_line_and_were_before_it_change_nothing(late: int) -> None:
    """Over a network the motion is computed anew, lines and all."""
    samples = street(3.0, seconds=6.2)
    behind = [
        number + (late + 1.5 if channel == "speed" and message.stamp_ns % 1_000_000_000 == 0 else 0)
        for number, (channel, message) in enumerate(samples)
    ]
    assert sorted(behind) != behind
    places = []
    for order in (range(len(samples)), np.argsort(behind)):
        estimator, received_ns, last = StateEstimator(info()), 0, None
        for number in order:
            channel, message = samples[number]
            received_ns = max(received_ns, message.stamp_ns + 1_000_000)
            state = estimator.handle(channel, message, received_ns=received_ns)
            if state is not None and state.yaw_valid and channel == "gnss":
                estimator.take_line(line(float(xy(state)[0]), 0.0))
            last = state or last
        assert last is not None
        assert last.map_shift_m is not None
        assert estimator.late.total() == 0
        places.append(xy(last))

    np.testing.assert_allclose(places[0], places[1], atol=0.02)
