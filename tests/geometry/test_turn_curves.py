"""Paths of turns: tangent to their lanes, as wide as the place allows, never tighter than said."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.geometry.turn_curves import MOST_LEFT_RAD, REACH_PER_RADIUS, turn_curves
from tests.world_gen.path_shape import bend_rad, tightest_radius_m

angles = st.floats(-math.pi, math.pi)


def _heading(angle: float) -> np.ndarray:
    return np.array([math.cos(angle), math.sin(angle)])


def _turn(start, yaw, end, end_yaw) -> tuple[np.ndarray, float]:
    found = turn_curves(
        np.array([start], dtype=float),
        _heading(yaw)[None],
        np.array([end], dtype=float),
        _heading(end_yaw)[None],
    )
    (path,) = found.lines.split()
    return path, float(found.radius_m[0])


@given(
    yaw=angles,
    turn=angles,
    ahead=st.floats(-5.0, 30.0),
    aside=st.floats(-30.0, 30.0),
)
def test_whatever_the_place_a_path_leaves_and_arrives_along_its_lanes(yaw, turn, ahead, aside):
    heading, out = _heading(yaw), _heading(yaw + turn)
    start = np.array([3.0, -7.0])
    end = start + ahead * heading + aside * _heading(yaw + math.pi / 2)
    if np.hypot(*(end - start)) < 3.0:
        return
    path, radius_m = _turn(start, yaw, end, yaw + turn)
    np.testing.assert_array_equal(path[0], start)
    np.testing.assert_array_equal(path[-1], end)
    if radius_m >= 4.0:
        assert bend_rad(path[1] - path[0], heading) < math.radians(1.0)
        assert bend_rad(path[-1] - path[-2], out) < math.radians(1.0)
        assert tightest_radius_m(path) > 0.93 * 4.0


@given(
    turn=st.floats(-2.8, 2.8),
    before=st.floats(0.5, 40.0),
    behind=st.floats(0.5, 40.0),
)
def test_where_lanes_cross_ahead_a_path_turns_no_farther_than_they_do(turn, before, behind):
    if abs(turn) < 0.1:
        return
    out = _heading(turn)
    end = before * _heading(0.0) + behind * out
    path, _ = _turn((0.0, 0.0), 0.0, end, turn)
    steps = np.diff(path, axis=0)
    yaw = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0])) * math.copysign(1.0, turn)
    assert yaw.min() > -MOST_LEFT_RAD - 0.05
    assert yaw.max() < abs(turn) + MOST_LEFT_RAD + 0.05


@given(yaw=angles, turn=angles, ahead=st.floats(-10.0, 30.0), aside=st.floats(-30.0, 30.0))
def test_no_path_that_a_car_can_drive_goes_round_in_a_loop(yaw, turn, ahead, aside):
    end = ahead * _heading(yaw) + aside * _heading(yaw + math.pi / 2)
    path, radius_m = _turn((0.0, 0.0), yaw, end, yaw + turn)
    if radius_m < 2.0:
        return
    steps = np.diff(path, axis=0)
    turned = np.unwrap([yaw, *np.arctan2(steps[:, 1], steps[:, 0])]) - yaw
    assert np.abs(turned).max() < math.radians(270.0)


@given(
    turn=st.floats(0.6, 2.4),
    radius_m=st.floats(5.0, 20.0),
    more=st.floats(0.0, 15.0),
    sign=st.sampled_from([-1, 1]),
)
def test_lanes_that_end_early_enough_are_joined_with_the_radius_they_were_cut_for(
    turn, radius_m, more, sign
):
    reach = REACH_PER_RADIUS * radius_m * math.tan(turn / 2.0)
    end = (reach + more) * _heading(0.0) + reach * _heading(sign * turn)
    path, found_m = _turn((0.0, 0.0), 0.0, end, sign * turn)
    assert found_m > 0.75 * radius_m  # less only where less steering does it
    assert tightest_radius_m(path) > 0.7 * radius_m


@given(turn=st.floats(0.35, 2.0), reach=st.floats(6.0, 30.0), more=st.floats(0.0, 15.0))
def test_curvature_rises_and_falls_without_a_jump(turn, reach, more):
    end = reach * _heading(0.0) + (reach + more) * _heading(turn)
    path, radius_m = _turn((0.0, 0.0), 0.0, end, turn)
    step = np.diff(path, axis=0)
    length = np.hypot(*step.T)
    middle = (length[1:] + length[:-1]) / 2.0
    bends = np.diff(np.unwrap(np.arctan2(step[:, 1], step[:, 0]))) / middle
    # From none to the greatest and back over at least a seventh of the turn each.
    room = np.maximum(middle[1:], middle[:-1]) / (turn * radius_m / 7.0)
    assert (np.abs(np.diff(bends)) < room / radius_m + 0.01).all()


def test_a_path_goes_on_with_the_bends_of_its_lanes():
    # A quarter of a ring of 20 m, between two lanes that go round with it.
    bend = np.array([1.0 / 20.0])
    found = turn_curves(
        np.array([[20.0, 0.0]]),
        np.array([[0.0, 1.0]]),
        np.array([[0.0, 20.0]]),
        np.array([[-1.0, 0.0]]),
        bend_pm=bend,
        end_bend_pm=bend,
    )
    (path,) = found.lines.split()
    np.testing.assert_allclose(np.hypot(*path.T), 20.0, atol=0.3)
    assert found.radius_m[0] > 16.0
    straight, _ = _turn((20.0, 0.0), math.pi / 2, (0.0, 20.0), math.pi)
    assert np.hypot(*straight.T).max() > 20.5


def test_lanes_in_line_are_joined_by_a_straight():
    path, radius_m = _turn((0.0, 0.0), 0.0, (10.0, 0.0), 0.0)
    assert math.isinf(radius_m)
    assert np.abs(path[:, 1]).max() == 0.0


def test_a_shift_aside_takes_the_whole_way():
    path, radius_m = _turn((0.0, 0.0), 0.0, (12.0, 3.5), 0.0)
    # Two arcs of one radius would have (length² + shift²) / (4 shift) = 11.2 m, and three jumps.
    assert 7.0 < radius_m < 11.2
    assert (np.diff(path[:, 1]) >= 0.0).all()


@pytest.mark.parametrize("beyond_m", [-6.0, 0.0, 6.0])
def test_a_u_turn_is_one_bow(beyond_m):
    path, radius_m = _turn((0.0, 0.0), 0.0, (beyond_m, 10.0), math.pi)
    assert radius_m > 3.4
    assert (np.diff(path[:, 1]) >= 0.0).all()


def test_a_gentler_path_that_leaves_the_angle_farther_is_not_taken():
    # The end lies to the right, where its lane leads to the left: some way back is needed.
    path, _ = _turn((0.0, 0.0), 0.0, (14.0, -3.0), 0.6)
    step = np.diff(path, axis=0)
    assert np.arctan2(step[:, 1], step[:, 0]).min() > math.radians(-28.0)


def test_many_paths_are_what_each_alone_is():
    rng = np.random.default_rng(5)
    start, end = rng.uniform(-3, 3, (20, 2)), rng.uniform(8, 14, (20, 2))
    yaw, end_yaw = rng.uniform(-1, 1, 20), rng.uniform(0, 2, 20)
    headings = np.stack([np.cos(yaw), np.sin(yaw)], axis=-1)
    ends = np.stack([np.cos(end_yaw), np.sin(end_yaw)], axis=-1)
    for i, path in enumerate(turn_curves(start, headings, end, ends).lines.split()):
        np.testing.assert_allclose(path, _turn(start[i], yaw[i], end[i], end_yaw[i])[0])


def test_lanes_that_nearly_touch_leave_no_room_to_turn_back():
    back = np.array([[-0.28, 0.96]]) / np.hypot(0.28, 0.96)
    found = turn_curves(
        np.array([[0.028, 22.94]]), np.array([[-0.29, -0.957]]), np.array([[-0.101, 22.94]]), back
    )
    assert found.radius_m.tolist() == [0.0]
