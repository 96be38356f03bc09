"""Polylines: offsets keep their distance, cuts keep their length."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.geometry.polyline import (
    cut,
    densified,
    evenly,
    headings_rad,
    interpolated,
    kept_apart,
    length,
    locate,
    meeting,
    offset,
    points_at,
    stretches,
    tangents,
    units,
)


@given(left=st.floats(-6.0, 6.0), bend=st.floats(-1.0, 1.0))
def test_an_offset_keeps_its_distance(left, bend):
    line = np.array([[0.0, 0.0], [30.0, 0.0], [30 + 30 * math.cos(bend), 30 * math.sin(bend)]])
    shifted = offset(line, left)
    for at in (1.0, length(shifted) - 1.0):
        point = points_at(shifted, at)
        gap = np.hypot(*(point - points_at(line, locate(line, point))))
        assert gap == pytest.approx(abs(left), abs=1e-6)


@given(yaw=st.floats(-3.2, 3.2), left_m=st.floats(-4.0, 4.0))
def test_a_straight_line_moves_to_its_left(yaw, left_m):
    along = np.array([math.cos(yaw), math.sin(yaw)])
    line = np.linspace(0.0, 20.0, 5)[:, None] * along
    left = np.array([-along[1], along[0]])
    np.testing.assert_allclose(offset(line, left_m), line + left_m * left, atol=1e-9)


def test_an_arc_to_the_left_moves_inward():
    angle = np.linspace(0.0, np.pi, 60)
    arc = 10.0 * np.column_stack([np.cos(angle), np.sin(angle)])
    np.testing.assert_allclose(np.hypot(*offset(arc, 2.0).T), 8.0, atol=0.01)


def test_directions_along_an_arc_are_those_of_its_tangents():
    angle = np.linspace(0.0, np.pi, 61)
    arc = 10.0 * np.column_stack([np.cos(angle), np.sin(angle)])
    square = np.column_stack([-np.sin(angle), np.cos(angle)])
    np.testing.assert_allclose(tangents(arc)[1:-1], square[1:-1], atol=1e-9)
    turned = np.unwrap(headings_rad(arc))[1:-1]
    np.testing.assert_allclose(turned, angle[1:-1] + math.pi / 2.0, atol=1e-9)


@given(length_m=st.floats(0.0, 200.0), spacing_m=st.floats(0.3, 20.0))
def test_pieces_are_even_and_no_longer_than_asked_for(length_m, spacing_m):
    bent = np.array([[0.0, 0.0], [0.4 * length_m, 0.0], [0.4 * length_m, 0.6 * length_m]])
    at_m = evenly(length(bent), spacing_m=spacing_m)
    steps = np.diff(at_m)
    assert at_m[-1] == length(bent)
    assert steps.max() <= spacing_m * (1.0 + 1e-9)
    assert steps == pytest.approx(steps[0])
    np.testing.assert_array_equal(densified(bent, spacing_m=spacing_m), points_at(bent, at_m))
    pieces = stretches(bent, spacing_m=spacing_m)
    assert pieces.at_m == pytest.approx((at_m[1:] + at_m[:-1]) / 2.0)
    np.testing.assert_array_equal(pieces.xy_m, points_at(bent, pieces.at_m))


def test_stretches_head_as_the_piece_that_holds_their_middle():
    corner = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 20.0]])
    found = stretches(corner, spacing_m=10.0)
    np.testing.assert_allclose(found.direction, [[1.0, 0.0], [0.0, 1.0], [0.0, 1.0]])


def test_rows_between_known_ones_are_held_at_the_ends():
    rows = np.array([[0.0, 1.0, 8.0], [2.0, 1.0, 4.0]])
    known = np.array([10.0, 20.0])
    np.testing.assert_allclose(
        interpolated(np.array([0.0, 15.0, 30.0]), known, rows), [rows[0], [1.0, 1.0, 6.0], rows[1]]
    )
    np.testing.assert_allclose(interpolated(15.0, known, rows), [1.0, 1.0, 6.0])


def test_points_of_a_car_that_stands_are_left_out():
    line = np.array([[0.0, 0.0], [0.3, 0.1], [0.6, 0.0], [0.9, 0.1], [5.0, 0.0]])
    np.testing.assert_array_equal(kept_apart(line, least_m=0.5), [0, 2, 4])
    np.testing.assert_array_equal(kept_apart(line[[0, 2, 4]], least_m=0.5), [0, 1, 2])


@given(yaw=st.floats(0.1, 3.0), ahead=st.floats(-9.0, 9.0), behind=st.floats(0.5, 9.0))
def test_lines_meet_where_both_of_them_pass(yaw, ahead, behind):
    a, along = np.array([1.0, 2.0]), np.array([1.0, 0.0])
    other = np.array([math.cos(yaw), math.sin(yaw)])
    b = a + ahead * along - behind * other
    assert meeting(a, along, b, other, parallel=1e-9) == pytest.approx((ahead, behind), abs=1e-6)
    assert np.isnan(meeting(a, along, b, along, parallel=1e-9)).all()


def test_vectors_of_any_shape_get_length_one_and_none_stays_none():
    found = units(np.array([[[3.0, 4.0], [0.0, 0.0]]]))
    np.testing.assert_allclose(found, [[[0.6, 0.8], [0.0, 0.0]]])


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


def test_what_is_left_of_a_tight_bend_is_joined_forwards():
    # A street in New York whose inner lane would run back by a quarter of a metre, then on.
    corner = np.array(
        [
            *([-50.539, 29.39], [-75.599, 39.128], [-76.009, 39.265], [-76.431, 39.364]),
            *([-76.86, 39.422], [-77.293, 39.44], [-77.725, 39.416], [-78.153, 39.352]),
            [-79.754, 39.036],
        ]
    )
    steps = np.diff(offset(corner, 5.49), axis=0)
    assert ((steps[1:] * steps[:-1]).sum(axis=1) > 0.0).all()
    np.testing.assert_allclose(
        offset(corner, 5.49)[[0, -1]], [[-52.53, 24.27], [-78.69, 33.65]], atol=0.02
    )


@given(begin=st.floats(0.0, 40.0), span=st.floats(0.1, 30.0))
def test_a_cut_has_the_length_asked_for(begin, span):
    line = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 30.0], [50.0, 30.0]])
    assert length(cut(line, begin, begin + span)) == pytest.approx(span, abs=1e-6)


def test_an_offset_keeps_the_nodes_of_short_steps():
    line = np.array([[0.0, 0.0], [10.0, 0.0], [10.1, 0.0], [20.0, 0.0]])
    np.testing.assert_allclose(offset(line, 2.0), line + np.array([0.0, 2.0]))


def test_no_points_have_no_length() -> None:
    assert length(np.empty((0, 2))) == 0.0
    assert length(np.ones((1, 2))) == 0.0
