"""A line with corners becomes a curve that can be driven, and leaves along its ends."""

from __future__ import annotations

import math

import numpy as np

from foretwin.geometry.splines import through_corners
from tests.world_gen.path_shape import bend_rad, tightest_radius_m

CORNERS = np.array([[0.0, 0.0], [2.0, 0.0], [25.0, 0.0], [25.0, 28.0], [45.0, 40.0], [47.0, 40.0]])


def _bends(path: np.ndarray) -> np.ndarray:
    steps = np.diff(path, axis=0)
    length = np.hypot(*steps.T)
    yaw = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
    return np.diff(yaw) / ((length[1:] + length[:-1]) / 2.0)


def test_ends_and_their_directions_stay():
    path = through_corners(CORNERS, radius_m=12.0)
    np.testing.assert_array_equal(path[[0, -1]], CORNERS[[0, -1]])
    assert bend_rad(path[1] - path[0], np.array([1.0, 0.0])) < math.radians(1.0)
    assert bend_rad(path[-1] - path[-2], np.array([1.0, 0.0])) < math.radians(1.0)
    assert abs(_bends(path)[0]) < 0.02
    steps = np.hypot(*np.diff(path, axis=0).T)
    assert steps[:4].max() < 1.2 * steps[:4].min()


def test_corners_are_rounded_without_a_jump_of_the_curvature():
    path = through_corners(CORNERS[:4], radius_m=8.0)
    # 2.5 m from the corner at most, hence a radius of 6 m in the middle of a right angle.
    assert tightest_radius_m(path) > 5.0
    assert np.abs(np.diff(_bends(path))).max() < 0.06
    assert np.hypot(*(path - CORNERS[2]).T).min() < 3.0


def test_a_line_without_corners_stays_straight():
    path = through_corners(np.array([[0.0, 0.0], [10.0, 0.0], [20.0, 0.0]]), radius_m=12.0)
    assert np.abs(path[:, 1]).max() == 0.0
    assert (np.diff(path[:, 0]) > 0.0).all()
