"""Turns back between lanes near to one another are wide enough for a car."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.geometry.back_turns import back_turns, with_bows
from foretwin.geometry.splines import through_corners
from tests.world_gen.path_shape import bend_rad, tightest_radius_m


@given(
    yaw=st.floats(-math.pi, math.pi),
    aside_m=st.floats(-8.0, 8.0),
    ahead_m=st.floats(-5.0, 5.0),
)
def test_whatever_the_gap_a_turn_back_has_a_radius_of_4_m_and_no_jump(yaw, aside_m, ahead_m):
    heading = np.array([math.cos(yaw), math.sin(yaw)])
    start = np.array([2.0, 3.0])
    end = start + ahead_m * heading + aside_m * np.array([-heading[1], heading[0]])
    (path,) = back_turns(start[None], heading[None], end[None], -heading[None]).split()
    np.testing.assert_array_equal(path[0], start)
    np.testing.assert_array_equal(path[-1], end)
    assert bend_rad(path[1] - path[0], heading) < math.radians(1.0)
    assert bend_rad(path[-1] - path[-2], -heading) < math.radians(1.0)
    assert tightest_radius_m(path) > 0.93 * 4.0
    steps = np.diff(path, axis=0)
    length = np.hypot(*steps.T)
    yaws = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
    bends = np.diff(yaws) / ((length[1:] + length[:-1]) / 2.0)
    assert np.abs(np.diff(bends)).max() < 0.25


def test_both_halves_are_mirror_images():
    ahead = np.array([[1.0, 0.0]])
    (path,) = back_turns(np.zeros((1, 2)), ahead, np.array([[0.0, 3.5]]), -ahead).split()
    np.testing.assert_allclose(path[::-1] * [1.0, -1.0] + [0.0, 3.5], path, atol=1.5e-3)


def test_a_turn_back_may_end_at_a_small_angle_to_the_lane_it_left():
    out = np.array([[-math.cos(0.2), math.sin(0.2)]])
    lines = back_turns(np.zeros((1, 2)), np.array([[1.0, 0.0]]), np.array([[0.0, 3.5]]), out)
    (path,) = lines.split()
    assert bend_rad(path[-1] - path[-2], out[0]) < math.radians(1.0)
    assert tightest_radius_m(path) > 3.0


@given(back_deg=st.floats(140.0, 178.0), left=st.booleans(), yaw=st.floats(-math.pi, math.pi))
def test_where_a_way_leads_back_at_its_tip_cars_turn_in_a_bow_beyond(back_deg, left, yaw):
    side = 1.0 if left else -1.0
    back = math.radians(back_deg)
    tip = np.array([40.0, 0.0])
    end = tip + 40.0 * np.array([math.cos(back), side * math.sin(back)])
    turned = np.array([[math.cos(yaw), math.sin(yaw)], [-math.sin(yaw), math.cos(yaw)]])
    line = np.array([[0.0, 0.0], [2.0, 0.0], tip, end - 0.05 * (end - tip), end]) @ turned
    bow = with_bows(line)
    np.testing.assert_array_equal(bow[[0, 1, -2, -1]], line[[0, 1, -2, -1]])
    assert np.hypot(*(bow - tip @ turned).T).max() < 40.1
    path = through_corners(bow, radius_m=12.0)
    assert tightest_radius_m(path) > 3.0
    steps = np.diff(path, axis=0)
    yaws = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
    # It goes round to the side to which the way turns, though it swings out first.
    assert side * (yaws[-1] - yaws[0]) == pytest.approx(back, abs=0.02)


def test_a_bend_that_leads_on_a_notch_and_the_ends_of_a_line_get_no_bow():
    bend = np.array([[0.0, 0.0], [20.0, 0.0], [10.0, 12.0], [10.0, 40.0]])
    np.testing.assert_array_equal(with_bows(bend), bend)
    notch = np.array(
        [[0.0, 0.0], [20.0, 0.0], [40.0, 0.0], [36.0, 0.5], [40.0, 30.0], [40.0, 40.0]]
    )
    np.testing.assert_array_equal(with_bows(notch), notch)
    at_end = np.array([[0.0, 0.0], [20.0, 0.0], [40.0, 0.0], [30.0, 0.5]])
    np.testing.assert_array_equal(with_bows(at_end), at_end)
