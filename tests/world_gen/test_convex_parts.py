"""Footprints as convex pieces: they cover the footprint, and notches and courtyards stay free."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from shapely.geometry import Point, Polygon

from world_gen.convex_parts import convex_parts

L_SHAPE = np.array([[0, 0], [20, 0], [20, 6], [6, 6], [6, 20], [0, 20]], dtype=np.float64)


def _area(parts: list[np.ndarray]) -> float:
    return sum(Polygon(p).area for p in parts)


def test_a_house_is_one_piece():
    assert len(convex_parts(np.array([[0.0, 0], [8, 0], [8, 5], [0, 5]]))) == 1


def test_the_notch_of_an_l_stays_free():
    parts = convex_parts(L_SHAPE)
    assert len(parts) == 2
    assert _area(parts) == pytest.approx(Polygon(L_SHAPE).area)
    assert not any(Polygon(p).intersects(Point(12, 12)) for p in parts)


def test_a_courtyard_stays_free():
    ring = np.array([[0.0, 0], [30, 0], [30, 30], [0, 30]])
    yard = np.array([[10.0, 10], [20, 10], [20, 20], [10, 20]])
    parts = convex_parts(ring, (yard,))
    assert _area(parts) == pytest.approx(800.0)
    assert not any(Polygon(p).contains(Point(15, 15)) for p in parts)


@given(
    st.lists(st.floats(4.0, 30.0), min_size=5, max_size=24),
    st.floats(0.0, 0.2),
)
def test_pieces_are_convex_and_keep_the_silhouette(radii, dent):
    turn = np.arange(len(radii)) * (2 * math.pi / len(radii))
    outline = np.array(radii)[:, None] * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    outline[0] *= 1.0 - dent
    parts = convex_parts(outline)
    for part in parts:
        piece = Polygon(part)
        assert piece.is_valid
        assert piece.exterior.is_ccw
        assert piece.convex_hull.area <= piece.area * 1.001 + 0.01
    whole, covered = Polygon(outline), shapely.union_all([Polygon(p).buffer(1e-6) for p in parts])
    assert covered.difference(whole.buffer(0.26)).area < 1e-3
    assert whole.buffer(-0.26).difference(covered).area < 1e-3


def test_a_self_crossing_footprint_still_has_pieces():
    bow = np.array([[0.0, 0], [10, 10], [10, 0], [0, 10]])
    assert _area(convex_parts(bow)) == pytest.approx(50.0, rel=0.05)
