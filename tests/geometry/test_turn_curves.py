"""Paths of turns: tangent to their lanes, as wide as the place allows, never tighter than said."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.geometry.turn_curves import LEAD_M, turn_curves
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
    assert bend_rad(path[1] - path[0], heading) < math.radians(1.0)
    assert bend_rad(path[-1] - path[-2], out) < math.radians(1.0)
    assert radius_m > 0.0
    if radius_m >= 4.0:
        assert tightest_radius_m(path) > 0.93 * 4.0


@given(ahead=st.floats(6.0, 40.0), sign=st.sampled_from([-1, 1]))
def test_a_right_angle_is_turned_with_the_widest_arc_that_fits(ahead, sign):
    path, radius_m = _turn((0.0, 0.0), 0.0, (ahead, sign * ahead), sign * math.pi / 2)
    assert radius_m == pytest.approx(ahead - LEAD_M)
    from_centre = np.hypot(*(path[1:-1] - [LEAD_M, sign * radius_m]).T)
    np.testing.assert_allclose(from_centre, radius_m, atol=2e-3)


def test_lanes_in_line_are_joined_by_a_straight():
    path, radius_m = _turn((0.0, 0.0), 0.0, (10.0, 0.0), 0.0)
    assert math.isinf(radius_m)
    assert np.abs(path[:, 1]).max() == 0.0


def test_a_shift_aside_takes_the_whole_way():
    path, radius_m = _turn((0.0, 0.0), 0.0, (12.0, 3.5), 0.0)
    # Two arcs of one radius: (length² + shift²) / (4 shift).
    assert radius_m == pytest.approx(((12.0 - 2 * LEAD_M) ** 2 + 3.5**2) / (4 * 3.5))
    assert (np.diff(path[:, 1]) >= 0.0).all()


@pytest.mark.parametrize("beyond_m", [-6.0, 0.0, 6.0])
def test_a_u_turn_is_a_half_circle(beyond_m):
    path, radius_m = _turn((0.0, 0.0), 0.0, (beyond_m, 10.0), math.pi)
    assert radius_m == pytest.approx(5.0)
    assert path[:, 0].max() == pytest.approx(max(beyond_m, 0.0) + LEAD_M + 5.0, abs=0.05)


def test_a_corner_too_tight_for_an_arc_begins_with_a_swing():
    path, radius_m = _turn((0.0, 0.0), 0.0, (6.5, -3.5), -math.pi / 2)
    assert radius_m > 3.5  # one arc would have 3.1 m
    assert path[:, 1].max() > 0.2


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
