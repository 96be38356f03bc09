"""Many polylines at once give what each alone gives."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.geometry import polyline
from foretwin.geometry import polyline_batch as batch
from foretwin.geometry.polyline_batch import Polylines

coordinate = st.integers(-400, 400).map(lambda tenths: tenths / 10)
points = st.tuples(coordinate, coordinate)
line = (
    st.lists(points, min_size=2, max_size=6, unique=True)
    .map(lambda xy: polyline.without_repeats(np.array(xy)))
    .filter(lambda xy: len(xy) >= 2)
)
lines = st.lists(line, min_size=1, max_size=4)


def same(found: Polylines, expected: list[np.ndarray]) -> None:
    assert len(found) == len(expected)
    for mine, other in zip(found.split(), expected, strict=True):
        np.testing.assert_allclose(mine, other, atol=1e-9)


@given(lines)
def test_split_undoes_joining(some):
    same(Polylines.of(some), some)


@given(lines)
def test_lengths(some):
    found = Polylines.of(some).length_m
    np.testing.assert_allclose(found, [polyline.length(xy) for xy in some])


@given(lines, st.data())
def test_points_along(some, data):
    at = [data.draw(st.floats(-5.0, 1.2 * polyline.length(xy) + 5.0)) for xy in some]
    found = batch.points_at(Polylines.of(some), np.arange(len(some)), np.array(at))
    expected = [polyline.points_at(xy, s) for xy, s in zip(some, at, strict=True)]
    np.testing.assert_allclose(found, expected, atol=1e-6)


@given(lines, st.data())
def test_cuts(some, data):
    shares = [sorted(data.draw(st.tuples(st.floats(0, 1), st.floats(0, 1)))) for _ in some]
    ends = [
        (a * polyline.length(xy), b * polyline.length(xy))
        for (a, b), xy in zip(shares, some, strict=True)
    ]
    found = batch.cut(Polylines.of(some), *np.array(ends).T)
    for mine, xy, (a, b) in zip(found.split(), some, ends, strict=True):
        alone = polyline.cut(xy, a, b)
        assert polyline.length(mine) == pytest.approx(polyline.length(alone), abs=1e-5)
        np.testing.assert_allclose(mine[[0, -1]], alone[[0, -1]], atol=1e-6)


@given(lines, st.floats(-6.0, 6.0))
def test_offsets(some, left_m):
    found = batch.offset(Polylines.of(some), np.full(len(some), left_m))
    same(found, [polyline.offset(xy, left_m) for xy in some])


@given(lines)
def test_offsets_of_roads_that_go_on(some):
    ahead = np.array([polyline.unit(xy[-1] - xy[0] + [1e-3, 2e-3]) for xy in some])
    found = batch.offset(
        Polylines.of(some), np.full(len(some), 1.5), before=ahead, after=np.full_like(ahead, np.nan)
    )
    same(found, [polyline.offset(xy, 1.5, before=d) for xy, d in zip(some, ahead, strict=True)])


@given(lines)
def test_repeats_are_dropped(some):
    doubled = [np.repeat(xy, 2, axis=0) for xy in some]
    same(batch.without_repeats(Polylines.of(doubled)), some)


@given(lines, st.data())
def test_chosen_rows(some, data):
    which = data.draw(st.lists(st.integers(0, len(some) - 1), max_size=8))
    found = Polylines.of(some).rows(np.array(which, dtype=np.int64))
    same(found, [some[i] for i in which])


def test_no_lines_at_all():
    empty = Polylines.of([])
    assert len(empty) == 0
    assert empty.split() == []
