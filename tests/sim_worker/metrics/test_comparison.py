from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.contracts.drive import PlannedTrajectory
from foretwin.contracts.frames import geo_from_local, geo_from_local_yaw
from foretwin.contracts.futures import Trajectory
from foretwin.geometry.constant_turn import constant_turn_rate
from foretwin.sim_worker.metrics.comparison import (
    ActualTrack,
    NominalTrack,
    compare_nominal,
    compare_plan,
    constant_velocity,
)
from foretwin.sim_worker.metrics.displacement import distinct_count, horizon_error
from tests.sim_worker.places import FRAME, straight_path

TIME_S = np.arange(0.0, 8.01, 0.1)


@given(st.floats(-3.0, 3.0), st.floats(-5.0, 5.0), st.floats(-5.0, 5.0), st.floats(-1.0, 1.0))
def test_a_constant_offset_is_told_apart_into_its_components(
    yaw: float, along: float, left: float, turned: float
) -> None:
    actual = np.column_stack([TIME_S * math.cos(yaw), TIME_S * math.sin(yaw), 0 * TIME_S + yaw])
    cos, sin = math.cos(yaw), math.sin(yaw)
    shift = np.array([along * cos - left * sin, along * sin + left * cos, turned])
    predicted = actual + shift
    error = horizon_error(predicted, actual)
    assert error.ade_m == pytest.approx(math.hypot(along, left), abs=1e-9)
    assert error.fde_m == pytest.approx(error.ade_m, abs=1e-9)
    assert error.longitudinal_m == pytest.approx(along, abs=1e-9)
    assert error.lateral_m == pytest.approx(left, abs=1e-9)
    assert error.heading_rad == pytest.approx(turned, abs=1e-9)


def test_a_speed_error_grows_linearly() -> None:
    actual = np.column_stack([10.0 * TIME_S, 0 * TIME_S, 0 * TIME_S])
    predicted = np.column_stack([11.0 * TIME_S, 0 * TIME_S, 0 * TIME_S])
    error = horizon_error(predicted[1:], actual[1:])
    assert error.fde_m == pytest.approx(8.0)
    assert error.ade_m == pytest.approx(8.1 / 2)


def test_unequal_or_empty_tracks_are_refused() -> None:
    with pytest.raises(ValueError, match="need"):
        horizon_error(np.zeros((3, 3)), np.zeros((4, 3)))
    with pytest.raises(ValueError, match="no instant"):
        horizon_error(np.zeros((0, 3)), np.zeros((0, 3)))


def test_constant_turn_rate_drives_a_circle_and_constant_velocity_a_line() -> None:
    start = np.array([1.0, 2.0, 0.5])
    turn = constant_turn_rate(start, speed_mps=8.0, yaw_rate_radps=0.4, time_s=TIME_S)
    centre = np.array([1.0 - 20 * math.sin(0.5), 2.0 + 20 * math.cos(0.5)])
    assert np.hypot(*(turn[:, :2] - centre).T) == pytest.approx(np.full(len(turn), 20.0))
    assert turn[-1, 2] == pytest.approx(0.5 + 3.2)
    line = constant_velocity(start, speed_mps=8.0, time_s=TIME_S)
    slow = constant_turn_rate(start, speed_mps=8.0, yaw_rate_radps=1e-5, time_s=TIME_S)
    assert slow == pytest.approx(line, abs=5e-3)


def _nominal() -> NominalTrack:
    poses = np.column_stack([9.0 * TIME_S, 0 * TIME_S + 0.5, 0 * TIME_S])
    return NominalTrack(5_000_000_000, TIME_S, poses, speed_mps=10.0, yaw_rate_radps=0.0)


def _actual(until_s: float, *, hole: tuple[float, float] = (99.0, 99.0)) -> ActualTrack:
    time_s = np.arange(-0.05, until_s, 0.1)
    time_s = time_s[(time_s < hole[0]) | (time_s > hole[1])]
    stamps = 5_000_000_000 + np.round(time_s * 1e9).astype(np.int64)
    return ActualTrack(stamps, np.column_stack([10.0 * time_s, 0 * time_s, 0 * time_s]))


def test_nominal_is_compared_beside_the_baselines_at_each_horizon() -> None:
    compared = compare_nominal(_nominal(), _actual(8.2), round_id=3, intersection_id="i")
    assert [c.horizon_s for c in compared] == [1.0, 2.0, 4.0, 8.0]
    for comparison in compared:
        horizon = comparison.horizon_s
        assert comparison.nominal.longitudinal_m == pytest.approx(-horizon)
        assert comparison.nominal.lateral_m == pytest.approx(0.5)
        assert comparison.nominal.fde_m == pytest.approx(math.hypot(horizon, 0.5))
        assert comparison.constant_velocity.lateral_m == pytest.approx(0.5)
        assert comparison.constant_velocity.longitudinal_m == pytest.approx(0.0, abs=1e-6)
        assert comparison.constant_turn_rate == comparison.constant_velocity


def test_only_horizons_that_the_track_covers_without_a_hole_are_compared() -> None:
    short = compare_nominal(_nominal(), _actual(3.0), round_id=3, intersection_id="i")
    assert [c.horizon_s for c in short] == [1.0, 2.0]
    holed = compare_nominal(
        _nominal(), _actual(9.0, hole=(4.5, 6.5)), round_id=3, intersection_id="i"
    )
    assert [c.horizon_s for c in holed] == [1.0, 2.0, 4.0]


def _plan(*, left_m: float, stamp_ns: int = 0) -> PlannedTrajectory:
    time_s = np.arange(0.0, 6.01, 0.2)
    xy = np.column_stack([-50.0 + 8.0 * time_s, 0 * time_s - 1.5 + left_m])
    geo = geo_from_local(FRAME, xy)
    return PlannedTrajectory(
        stamp_ns=stamp_ns,
        time_from_stamp_s=time_s,
        lat_deg=geo[:, 0],
        lon_deg=geo[:, 1],
        yaw_rad=geo_from_local_yaw(FRAME, 0 * time_s, xy),
        speed_mps=0 * time_s + 8.0,
    )


def _trajectory(stamp_ns: int) -> Trajectory:
    states = np.zeros((1, len(TIME_S), 8), dtype=np.float32)
    states[0, :, 0] = -50.0 + 8.0 * (TIME_S + stamp_ns / 1e9)
    states[0, :, 1] = -1.5
    return Trajectory(stamp_ns=stamp_ns, time_s=TIME_S, states=states)


@pytest.mark.parametrize("left_m", [1.0, -0.5])
def test_a_shifted_plan_is_reported_as_that_shift(left_m: float) -> None:
    found = compare_plan(
        _plan(left_m=left_m),
        _trajectory(400_000_000),
        straight_path(),
        world_frame=FRAME,
        round_id=1,
    )
    assert found is not None
    assert found.difference.lateral_m == pytest.approx(left_m, abs=1e-3)
    assert found.difference.ade_m == pytest.approx(abs(left_m), abs=1e-3)
    assert found.path_offset_m == pytest.approx(left_m, abs=1e-3)
    assert found.horizon_s == pytest.approx(5.6)


def test_a_plan_of_another_time_is_not_compared() -> None:
    assert (
        compare_plan(
            _plan(left_m=0.0),
            _trajectory(60_000_000_000),
            straight_path(),
            world_frame=FRAME,
            round_id=1,
        )
        is None
    )


def test_distinct_ends_are_counted_once() -> None:
    ends = np.array([[0.0, 0.0], [0.05, 0.0], [0.2, 0.0], [0.2, 0.01], [5.0, 5.0], [np.nan, 0.0]])
    assert distinct_count(ends, 0.1) == distinct_count(ends[::-1], 0.1) == 3
