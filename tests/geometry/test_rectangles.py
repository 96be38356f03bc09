from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from foretwin.geometry.rectangles import Rectangles, clearance, corners, overlapping, separations

near = st.floats(-8.0, 8.0)
angle = st.floats(-7.0, 7.0)
size = st.floats(0.5, 6.0)


@settings(max_examples=150, deadline=None)
@given(st.tuples(near, near, angle, size, size), st.tuples(near, near, angle, size, size))
def test_clearance_and_overlap_are_those_of_shapely(
    a: tuple[float, ...], b: tuple[float, ...]
) -> None:
    first, second = (
        Rectangles(np.array([[x, y]]), np.array([yaw]), length, width)
        for x, y, yaw, length, width in (a, b)
    )
    theirs = [shapely.Polygon(corners(r)[0]) for r in (first, second)]
    distance = theirs[0].distance(theirs[1])
    assert abs(clearance(first, second)[0] - distance) < 1e-6
    if distance > 1e-6:
        assert not overlapping(first, second)[0]
    elif theirs[0].intersection(theirs[1]).area > 1e-6:
        assert overlapping(first, second)[0]


def test_many_pairs_at_once() -> None:
    centres = np.stack([np.arange(5.0) * 3.0, np.zeros(5)], axis=1)
    one = Rectangles(np.zeros((5, 2)), np.zeros(5), 4.0, 2.0)
    other = Rectangles(centres, np.zeros(5), 4.0, 2.0)
    assert overlapping(one, other).tolist() == [True, True, False, False, False]
    assert clearance(one, other).tolist() == [0.0, 0.0, 2.0, 5.0, 8.0]


def test_each_pair_may_have_sizes_of_its_own() -> None:
    lorry_and_child = np.array([[8.0, 2.5], [0.4, 0.3]])
    car = Rectangles(np.zeros((2, 2)), np.zeros(2), 4.0, 2.0)
    other = Rectangles(np.array([[7.0, 0.0], [7.0, 0.0]]), np.zeros(2), *lorry_and_child.T)
    assert clearance(car, other) == pytest.approx([1.0, 4.8])
    assert separations(car, other).max(axis=0) == pytest.approx([1.0, 4.8])
    assert corners(other)[:, 0] == pytest.approx(np.array([[11.0, 1.25], [7.2, 0.15]]))


@settings(max_examples=60, deadline=None)
@given(st.tuples(near, near, angle, size, size), st.tuples(near, near, angle, size, size))
def test_a_separation_never_exceeds_the_distance(
    a: tuple[float, ...], b: tuple[float, ...]
) -> None:
    first, second = (
        Rectangles(np.array([[x, y]]), np.array([yaw]), length, width)
        for x, y, yaw, length, width in (a, b)
    )
    gap = separations(first, second).max(axis=0)[0]
    assert gap <= clearance(first, second)[0] + 1e-9
    assert (gap > 0.0) == (not overlapping(first, second)[0])
