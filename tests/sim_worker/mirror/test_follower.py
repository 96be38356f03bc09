"""The follower keeps its bounds whatever it is told; constant gaps close without overshoot."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from foretwin.sim_worker.mirror.follower import Follower

STEP_S = 0.01
LIMITS = st.tuples(st.floats(0.1, 5.0), st.floats(1.0, 20.0)).map(lambda a: (a[0], a[0] * a[1]))
"""Of acceleration, and of jerk: 1 to 20 times as much a second."""
SIGNALS = st.lists(
    st.tuples(st.floats(-1e3, 1e3), st.floats(-50.0, 50.0), st.integers(1, 60)), min_size=1
)


def follower(accel: float, jerk: float, *, count: int = 1) -> Follower:
    return Follower(max_accel=np.full(count, accel), max_jerk=np.full(count, jerk))


@given(limits=LIMITS, signals=SIGNALS)
def test_acceleration_and_jerk_keep_their_bounds_whatever_the_gap_does(
    limits: tuple[float, float], signals: list[tuple[float, float, int]]
) -> None:
    accel, jerk = limits
    one = follower(accel, jerk)
    accels, velocities, moves = [0.0], [0.0], []
    for gap, rate, steps in signals:
        for _ in range(steps):
            moves.append(one.step(np.array([gap]), np.array([rate]), STEP_S)[0])
            accels.append(one.acceleration[0])
            velocities.append(one.velocity[0])
    assert np.abs(accels).max() <= accel * (1 + 1e-12)
    assert np.abs(np.diff(accels)).max() <= jerk * STEP_S * (1 + 1e-12) + 1e-15
    # Acceleration is continuous, and velocity and displacement are its integrals.
    mean = 0.5 * (np.array(accels[1:]) + accels[:-1])
    assert np.diff(velocities) == pytest.approx(mean * STEP_S, abs=1e-12)
    middle = 0.5 * (np.array(velocities[1:]) + velocities[:-1])
    assert np.array(moves) == pytest.approx(middle * STEP_S, abs=1e-12)


def close(one: Follower, gaps: np.ndarray, *, until_s: float) -> np.ndarray:
    """What is left (N, K) of gaps that change by our own velocity alone, step by step."""
    left = [gaps]
    for _ in range(round(until_s / STEP_S)):
        left.append(left[-1] - one.step(left[-1], -one.velocity, STEP_S))
    return np.array(left)


@settings(max_examples=15)
@given(limits=LIMITS, largest=st.floats(0.01, 40.0))
def test_constant_gaps_close_without_overshoot(limits: tuple[float, float], largest: float) -> None:
    accel, jerk = limits
    gaps = np.concatenate([-np.geomspace(0.001, 1.0, 30), np.geomspace(0.001, 1.0, 30)]) * largest
    course = close(follower(accel, jerk, count=len(gaps)), gaps, until_s=25.0) / gaps
    assert course.min() > -0.05
    pace = jerk / (2.0 * accel)
    cruise_s = np.abs(gaps) / (2.0 * accel / (3.0 * pace))
    assert np.abs(course[-1, cruise_s + 12.0 / pace < 25.0]).max(initial=0.0) < 0.01


def test_a_gap_of_a_metre_is_closed_to_5_percent_in_6_seconds_and_a_half() -> None:
    course = close(follower(1.0, 2.0), np.array([1.0]), until_s=10.0)[:, 0]
    assert np.argmax(course < 0.05) * STEP_S == pytest.approx(6.3, abs=0.1)
    assert course.min() > -1e-6


@settings(max_examples=10)
@given(limits=LIMITS, accel_share=st.floats(-1.0, 1.0))
def test_what_is_no_longer_followed_comes_to_rest_within_the_bounds(
    limits: tuple[float, float], accel_share: float
) -> None:
    accel, jerk = limits
    speeds = np.linspace(-2.0, 2.0, 41) * accel
    one = follower(accel, jerk, count=len(speeds))
    one.velocity, one.acceleration = speeds, np.full_like(speeds, accel_share * accel)
    accels = [one.acceleration]
    while not one.at_rest:
        one.fade(STEP_S)
        accels.append(one.acceleration)
        assert len(accels) < 6000
    assert np.abs(accels).max() <= accel * (1 + 1e-12)
    assert np.abs(np.diff(accels[:-1], axis=0)).max() <= jerk * STEP_S * (1 + 1e-12)


@pytest.mark.parametrize(("accel", "jerk"), [(0.0, 1.0), (1.0, -2.0), (0.1, 50.0)])
def test_limits_that_make_no_sense_are_refused(accel: float, jerk: float) -> None:
    with pytest.raises(ValueError, match="limit"):
        follower(accel, jerk)
