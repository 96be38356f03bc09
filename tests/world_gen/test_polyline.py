"""Polylines: turns are smooth, offsets keep their distance, cuts keep their length."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from world_gen.polyline import (
    cut,
    length,
    locate,
    offset,
    points_at,
    rounded,
    turn_curve,
)

angles = st.floats(-math.pi, math.pi)
metres = st.floats(3.0, 40.0)


def _heading(angle: float) -> np.ndarray:
    return np.array([math.cos(angle), math.sin(angle)])


@given(turn=st.floats(-2.6, 2.6), ahead=metres, beyond=metres, yaw=angles)
def test_a_turn_leaves_and_arrives_along_its_lanes(turn, ahead, beyond, yaw):
    start, heading, out = np.array([3.0, -7.0]), _heading(yaw), _heading(yaw + turn)
    end = start + ahead * heading + beyond * out
    path = turn_curve(start, heading, end, out)
    np.testing.assert_allclose(path[0], start, atol=1e-9)
    np.testing.assert_allclose(path[-1], end, atol=1e-9)
    first, last = path[1] - path[0], path[-1] - path[-2]
    assert first @ heading / np.hypot(*first) > math.cos(math.radians(6.0))
    assert last @ out / np.hypot(*last) > math.cos(math.radians(6.0))
    steps = np.diff(path, axis=0)
    bends = np.arctan2(
        steps[:-1, 0] * steps[1:, 1] - steps[:-1, 1] * steps[1:, 0],
        (steps[:-1] * steps[1:]).sum(axis=1),
    )
    assert np.abs(bends).max() < math.radians(35.0)


@given(ahead=st.floats(6.0, 40.0), sign=st.sampled_from([-1, 1]))
def test_a_right_angle_is_turned_with_the_widest_arc_that_fits(ahead, sign):
    out = np.array([0.0, float(sign)])
    path = turn_curve(np.zeros(2), np.array([1.0, 0.0]), np.array([ahead, sign * ahead]), out)
    from_centre = np.hypot(*(path - np.array([0.0, sign * ahead])).T)
    np.testing.assert_allclose(from_centre, ahead, rtol=2e-3)


@given(left=st.floats(-6.0, 6.0), bend=st.floats(-1.0, 1.0))
def test_an_offset_keeps_its_distance(left, bend):
    line = np.array([[0.0, 0.0], [30.0, 0.0], [30 + 30 * math.cos(bend), 30 * math.sin(bend)]])
    shifted = offset(line, left)
    for at in (1.0, length(shifted) - 1.0):
        point = points_at(shifted, at)
        gap = np.hypot(*(point - points_at(line, locate(line, point))))
        assert gap == pytest.approx(abs(left), abs=1e-6)


def test_shifted_pieces_of_one_road_meet_where_directions_beyond_are_given():
    a, b = np.array([[0.0, 0.0], [20.0, 0.0]]), np.array([[20.0, 0.0], [35.0, 10.0]])
    along = (b[1] - b[0]) / np.hypot(*(b[1] - b[0]))
    end = offset(a, 3.0, after=along)[-1]
    begin = offset(b, 3.0, before=np.array([1.0, 0.0]))[0]
    np.testing.assert_allclose(end, begin, atol=1e-9)


def test_an_offset_to_the_inside_of_a_tight_bend_never_runs_backwards():
    hook = np.array([[0.0, 0.0], [10.0, 0.0], [10.5, 0.5], [10.0, 1.0], [0.0, 1.0]])
    shifted = offset(hook, 2.0)
    assert np.isfinite(shifted).all()
    assert length(shifted) < length(hook)


@given(begin=st.floats(0.0, 40.0), span=st.floats(0.1, 30.0))
def test_a_cut_has_the_length_asked_for(begin, span):
    line = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 30.0], [50.0, 30.0]])
    assert length(cut(line, begin, begin + span)) == pytest.approx(span, abs=1e-6)


def test_rounding_stays_near_the_line_and_keeps_its_ends():
    line = np.array([[0.0, 0.0], [20.0, 0.0], [30.0, 17.0], [60.0, 17.0]])
    smooth = rounded(line, deviation_m=0.35)
    np.testing.assert_array_equal(smooth[[0, -1]], line[[0, -1]])
    gaps = [np.hypot(*(p - points_at(line, locate(line, p)))) for p in smooth]
    assert max(gaps) <= 0.36
    assert len(smooth) > len(line)
