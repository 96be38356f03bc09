"""Bends: rounded so that the lane on the inside can be driven, across nodes where ways are cut."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from shapely.geometry import LineString

from foretwin.geometry.bends import rounded_through, thinned, without_end_kinks
from foretwin.geometry.polyline import length
from foretwin.geometry.polyline_batch import Polylines
from tests.world_gen.path_shape import bend_rad, tightest_radius_m

NOTHING = np.full((1, 2), np.nan)


def _rounded(line, radius_m=7.0, before=NOTHING, after=NOTHING):
    lines = Polylines.of([np.array(line, dtype=float)])
    return rounded_through(lines, np.array([radius_m]), before, after)


@given(bend=st.floats(-1.9, 1.9), leg=st.floats(15.0, 60.0))
def test_a_bend_gets_the_radius_asked_for_where_it_fits(bend, leg):
    line = [(0.0, 0.0), (leg, 0.0), (leg + leg * math.cos(bend), leg * math.sin(bend))]
    (path,) = _rounded(line).lines.split()
    np.testing.assert_array_equal(path[[0, -1]], np.array(line)[[0, -1]])
    steps = np.diff(path, axis=0)
    assert bend_rad(steps[0], np.array([1.0, 0.0])) < 1e-6
    if abs(bend) > math.radians(3.0):
        # At most 2.5 m from the corner, and 0.45 of the shorter leg.
        fits = min(
            7.0, 2.5 / (1.0 / math.cos(bend / 2) - 1.0), 0.45 * leg / abs(math.tan(bend / 2))
        )
        assert tightest_radius_m(path) > 0.98 * fits


@given(bend=st.floats(-1.2, 1.2), first=st.floats(8.0, 40.0), second=st.floats(8.0, 40.0))
def test_a_road_cut_at_a_bend_is_rounded_as_if_it_were_whole(bend, first, second):
    a, b = np.array([0.0, 0.0]), np.array([first, 0.0])
    c = b + second * np.array([math.cos(bend), math.sin(bend)])
    (whole,) = _rounded([a, b, c]).lines.split()
    (start,) = _rounded([a, b], after=c[None]).lines.split()
    (stop,) = _rounded([b, c], before=a[None]).lines.split()
    np.testing.assert_allclose(start[-1], stop[0], atol=1e-9)
    # Square to the same chord, so that lanes beside the one meet lanes beside the other.
    assert bend_rad(start[-1] - start[-2], stop[1] - stop[0]) < math.radians(0.06)
    both = LineString(np.concatenate([start, stop[1:]]))
    assert both.hausdorff_distance(LineString(whole)) < 0.25  # chords of one arc


def test_what_lies_beyond_an_end_is_the_other_half_of_the_chord():
    a, b, c = np.array([0.0, 0.0]), np.array([20.0, 0.0]), np.array([20.0, 20.0])
    first = _rounded([a, b], after=c[None])
    second = _rounded([b, c], before=a[None])
    ahead = np.diff(second.lines.xy_m, axis=0)[0]
    np.testing.assert_allclose(first.after[0], ahead / np.hypot(*ahead), atol=1e-9)
    assert np.isnan(first.before).all()


def test_points_too_close_to_tell_a_direction_go():
    line = np.array([[0, 0], [0.1, 0.1], [5, 0], [5.1, 0.0], [9.9, 0.2], [10, 0]], dtype=float)
    (kept,) = thinned(Polylines.of([line])).split()
    np.testing.assert_array_equal(kept, line[[0, 2, 5]])


def test_a_stub_before_a_bend_goes_where_a_junction_cut_it():
    line = np.array([[0, 0], [0.5, 0.5], [30, 0.5], [30.0, 1.5]])
    lines = Polylines.of([line, line])
    cut, whole = np.array([True, False]), np.array([False, False])
    first, second = without_end_kinks(lines, cut, whole).split()
    np.testing.assert_array_equal(first, line[[0, 2, 3]])
    np.testing.assert_array_equal(second, line)
    first, _ = without_end_kinks(lines, cut, cut).split()
    np.testing.assert_array_equal(first, line[[0, 3]])


@given(st.lists(st.tuples(st.floats(-50, 50), st.floats(-50, 50)), min_size=2, max_size=30))
def test_thinning_keeps_both_ends(points):
    line = np.array(points)
    if length(line) < 1.0:
        return
    (kept,) = thinned(Polylines.of([line])).split()
    np.testing.assert_array_equal(kept[[0, -1]], line[[0, -1]])
    if len(kept) > 2:
        assert np.hypot(*np.diff(kept, axis=0).T).min() >= 0.25
