"""Positions once a second and nothing else: the motion follows them and does not swing."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from foretwin.contracts.drive import VehicleState
from foretwin.telemetry.estimator.filter_state import ACCEL, CURVATURE, SPEED, YAW
from foretwin.telemetry.estimator.kinematic_filter import KinematicFilter
from foretwin.telemetry.estimator.position_gate import LocalFix
from foretwin.telemetry.estimator.sparse_fixes import bear_anew, follow_fixes, sparse, turned_m
from tests.telemetry.position_track import along, circle, states_of, xy, yaw
from tests.telemetry.winding_drive import TICK_S, WINDING, driven, truly


def once_a_second(
    place: Callable[[float], tuple[float, float]], duration_s: float
) -> list[VehicleState]:
    return states_of(along(place, duration_s)[::5])


def test_a_bend_is_followed_without_swinging() -> None:
    for state in once_a_second(circle, 40.0)[6:]:
        time_s = state.stamp_ns * 1e-9
        assert state.speed_mps == pytest.approx(6.0, abs=0.4)
        assert abs(math.remainder(yaw(state) - 0.4 * time_s, math.tau)) < 0.1
        assert xy(state) == pytest.approx(circle(time_s), abs=0.01)


def test_who_pulls_away_and_turns_soon_is_not_held_back() -> None:
    """It drives in to a stop for 8 s, then pulls away at 2 m/s² into a bend of 12 m."""

    def place(time_s: float) -> tuple[float, float]:
        if time_s < 10.0:
            return 0.5 * (time_s**2 - max(0.0, time_s - 5.0) ** 2 * 2.0), 0.0
        way = max(0.0, time_s - 18.0) ** 2 if time_s < 21.0 else 9.0 + 6.0 * (time_s - 21.0)
        return 25.0 + 12.0 * math.sin(way / 12.0), 12.0 * (1.0 - math.cos(way / 12.0))

    states = once_a_second(place, 30.0)
    for state in states[3:]:
        assert xy(state) == pytest.approx(place(state.stamp_ns * 1e-9), abs=0.02)
    faster = [state for state in states if state.stamp_ns >= 20_900_000_000]
    assert all(state.speed_mps == pytest.approx(6.0, abs=1.2) for state in faster)


@pytest.mark.parametrize(("every_s", "off_m", "turned_rad"), [(1.0, 0.1, 0.1), (2.0, 0.1, 0.35)])
def test_wheels_beside_them_tell_of_no_turn(
    every_s: float, off_m: float, turned_rad: float
) -> None:
    """A filter that knows its speed well swung about the truth, by 30 m and the wrong way round."""
    _, states = driven(gyro=None, wheels=truly, fix_every=round(every_s / TICK_S))
    assert len(states) == 120.0 / every_s
    for tick, state in states[4:]:
        speed, _, heading, *place = WINDING[tick]
        assert xy(state) == pytest.approx(place, abs=off_m)
        assert state.speed_mps == pytest.approx(speed, abs=0.1)
        assert abs(math.remainder(yaw(state) - heading, math.tau)) < turned_rad


@pytest.mark.parametrize("speed_mps", [5.0, -5.0])
def test_a_heading_that_was_lost_is_found_in_the_fixes(speed_mps: float) -> None:
    filter_ = KinematicFilter(xy_m=np.zeros(2), yaw_rad=0.0, speed_mps=speed_mps, yaw_std_rad=1.0)
    fixes = [
        LocalFix(t, 20.0 * np.array([math.sin(t / 4.0), 1.0 - math.cos(t / 4.0)]))
        for t in (0.0, 1.0, 2.0)
    ]
    assert bear_anew(filter_, fixes, 0.02, 0.02, (0.0, 0.0))
    facing = 0.5 if speed_mps > 0.0 else 0.5 - math.pi
    assert filter_.mean[:2] == pytest.approx(fixes[-1].xy_m)
    assert math.remainder(filter_.mean[YAW] - facing, math.tau) == pytest.approx(0.0, abs=0.05)
    assert filter_.mean[CURVATURE] == pytest.approx(math.copysign(0.05, speed_mps), abs=0.01)
    assert filter_.mean[SPEED] == speed_mps
    assert not bear_anew(filter_, fixes, 0.02, 0.02, (0.0, 0.0)), "it is known now"


def test_the_quadratic_tells_speed_course_and_bend() -> None:
    filter_ = KinematicFilter(xy_m=np.zeros(2), yaw_rad=0.9, speed_mps=3.0, yaw_std_rad=0.5)
    filter_.covariance[SPEED, SPEED] = filter_.covariance[CURVATURE, CURVATURE] = 100.0
    # A car on a circle of 20 m at 5 m/s; its quadratic's course at the end lags by little.
    fixes = [
        LocalFix(t, 20.0 * np.array([math.sin(t / 4.0), 1.0 - math.cos(t / 4.0)]))
        for t in (0.0, 1.0, 2.0, 3.0)
    ]
    follow_fixes(filter_, fixes, 0.02, turning=True)
    assert filter_.mean[SPEED] == pytest.approx(5.0, abs=0.2)
    assert filter_.mean[YAW] == pytest.approx(0.75, abs=0.1)
    assert filter_.mean[CURVATURE] == pytest.approx(0.05, abs=0.02)
    assert filter_.mean[ACCEL] == pytest.approx(0.0, abs=0.5)


@pytest.mark.parametrize(
    ("times_s", "are"),
    [
        ((0.0, 1.0, 2.0, 3.0), True),
        ((0.0, 0.5, 1.0, 1.5), True),
        ((0.0, 0.2, 0.4, 0.6), False),
        ((0.0, 0.2, 0.8, 1.4), False),  # of a fast receiver two were held back
        ((0.0, 1.0, 2.0, 9.0), False),
        ((0.0, 1.0, 2.0), False),
    ],
)
def test_fixes_are_sparse_where_all_of_the_latest_are(
    times_s: tuple[float, ...], are: bool
) -> None:
    assert sparse([LocalFix(t, np.zeros(2)) for t in times_s]) is are


def test_a_turn_or_a_stop_between_sparse_fixes_is_no_glitch() -> None:
    slow = [LocalFix(float(t), np.zeros(2)) for t in range(4)]
    fast = [LocalFix(0.2 * t, np.zeros(2)) for t in range(4)]
    assert turned_m(slow) == pytest.approx(2.0)  # half of 4 m/s² for a second
    assert turned_m(fast) == 0.0


def test_who_backs_keeps_the_heading() -> None:
    """It faces east and rolls west at 2 m/s."""
    filter_ = KinematicFilter(xy_m=np.zeros(2), yaw_rad=0.0, speed_mps=-2.0, yaw_std_rad=0.1)
    fixes = [LocalFix(float(t), np.array([-2.0 * t, 0.0])) for t in range(4)]
    follow_fixes(filter_, fixes, 0.02, turning=True)
    assert filter_.mean[YAW] == pytest.approx(0.0, abs=0.02)
    assert filter_.mean[SPEED] == pytest.approx(-2.0, abs=0.1)


def test_where_headings_are_heard_fixes_tell_of_the_speed_alone() -> None:
    filter_ = KinematicFilter(xy_m=np.zeros(2), yaw_rad=0.2, speed_mps=5.0, yaw_std_rad=0.1)
    fixes = [LocalFix(float(t), np.array([8.0 * t, 0.0])) for t in range(4)]
    follow_fixes(filter_, fixes, 0.02, turning=False)
    assert filter_.mean[YAW] == 0.2
    assert filter_.mean[SPEED] == pytest.approx(8.0 * np.cos(0.2), abs=0.6)
