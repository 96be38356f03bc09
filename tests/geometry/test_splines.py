"""A line with corners becomes a curve that can be driven, and leaves along its ends."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from foretwin.geometry.splines import arcs_through, through_corners
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


NOWHERE = np.array([math.nan, math.nan])
STEP_RAD = math.radians(3.0)


def _on_circle(turned_rad: np.ndarray, radius_m: float, *, sign: float) -> np.ndarray:
    around = sign * turned_rad
    return radius_m * np.stack([np.cos(around), np.sin(around)], axis=-1)


@given(
    st.floats(5.0, 80.0), st.lists(st.floats(0.2, 1.2), min_size=4, max_size=9),
    st.sampled_from([1.0, -1.0]),
)  # fmt: skip
def test_points_of_a_circle_give_the_circle(radius_m: float, turns: list[float], sign: float):
    points = _on_circle(np.cumsum(turns), radius_m, sign=sign)
    for piece in arcs_through(points[1:-1], points[0], points[-1], step_rad=STEP_RAD):
        assert np.allclose(np.hypot(*piece.T), radius_m)
        assert np.abs(np.diff(np.unwrap(np.arctan2(*piece.T)))).max() < 1.01 * STEP_RAD


@given(st.lists(st.tuples(st.floats(-0.4, 0.4), st.floats(9.5, 10.5)), min_size=8, max_size=14))
def test_a_ring_drawn_badly_is_passed_through_without_a_kink(drawn: list[tuple[float, float]]):
    even = np.arange(len(drawn)) * math.tau / len(drawn)
    away = np.array([radius for _, radius in drawn])
    even += np.array([late for late, _ in drawn]) / len(drawn)
    ring = np.stack([away * np.cos(even), away * np.sin(even)], axis=-1)
    pieces = arcs_through(np.concatenate([ring, ring[:1]]), ring[-1], ring[1], step_rad=0.01)
    for piece, begin, end in zip(pieces, ring, np.roll(ring, -1, axis=0), strict=True):
        assert (piece[[0, -1]] == [begin, end]).all()
    for one, other in pairwise(pieces):
        assert bend_rad(one[-1] - one[-2], other[1] - other[0]) < math.radians(2.0)


def test_a_chord_is_straight_where_nothing_says_how_it_bends():
    corner = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 10.0]])
    lone, *_ = arcs_through(corner[:2], NOWHERE, NOWHERE, step_rad=STEP_RAD)
    assert (lone == corner[:2]).all()
    hook, _ = arcs_through(
        np.array([[0.0, 0.0], [3.0, 0.0], [2.0, 2.0]]), NOWHERE, NOWHERE, step_rad=STEP_RAD
    )
    assert np.allclose(hook[:, 1], 0.0)
