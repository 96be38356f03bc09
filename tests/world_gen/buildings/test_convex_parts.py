"""Footprints as convex pieces: they cover the footprint, and notches and courtyards stay free."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
import shapely.affinity
from hypothesis import given
from hypothesis import strategies as st
from shapely.geometry import Point, Polygon

from foretwin.world_gen.buildings.convex_parts import (
    COLLISION_TOLERANCE_M,
    convex_cover,
)

COVERS = ("foretwin.geometry.reflex_cuts",)

L_SHAPE = np.array([[0, 0], [20, 0], [20, 6], [6, 6], [6, 20], [0, 20]], dtype=np.float64)


def convex_parts(outline: np.ndarray, holes: tuple[np.ndarray, ...] = ()) -> list[np.ndarray]:
    return convex_cover([(outline, holes)]).rings


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
    assert _area(parts) == pytest.approx(800.0, rel=1e-3)
    assert not any(Polygon(p).contains(Point(15, 15)) for p in parts)


def test_square_walls_become_boxes_and_skewed_ones_do_not():
    wedge = np.array([[0.0, 0], [12, 0], [5, 9]])
    parts = convex_cover([(L_SHAPE, ()), (wedge, ())])
    assert parts.owner.tolist() == [0, 0, 1]
    assert parts.is_box.tolist() == [True, True, False]
    for k in (0, 1):
        turned = Polygon(parts.rings[k]).minimum_rotated_rectangle
        assert parts.half_m[k].prod() * 4 == pytest.approx(turned.area)
        along = np.array([np.cos(parts.yaw_rad[k]), np.sin(parts.yaw_rad[k])])
        corner = parts.centre_m[k] - parts.half_m[k] @ np.stack([along, [-along[1], along[0]]])
        np.testing.assert_allclose(corner, parts.rings[k][0], atol=1e-9)


def test_no_outline_has_no_parts():
    assert convex_cover([]).rings == []


def test_a_pocket_behind_a_thin_spike_stays_free():
    spiked = [[0, 0], [10.88, -22.97], [-2.85, -29.44], [1.87, -39.4], [15.63, -32.92],
              [13.87, -29.2], [27.83, -22.63], [13.99, 6.59]]  # fmt: skip
    _assert_silhouette_kept(Polygon(spiked), convex_parts(np.array(spiked, dtype=np.float64)))


def _assert_silhouette_kept(whole: Polygon, parts: list[np.ndarray]) -> None:
    for part in parts:
        piece = Polygon(part)
        assert piece.exterior.is_ccw
        assert piece.convex_hull.area <= piece.area * 1.001 + 0.01
    covered = shapely.union_all([Polygon(p).buffer(1e-3) for p in parts])
    slack = COLLISION_TOLERANCE_M + 2e-3
    assert covered.difference(whole.buffer(slack)).area < 1e-3
    assert whole.buffer(-slack).difference(covered).area < 1e-3


@st.composite
def _outlines(draw: st.DrawFn) -> Polygon:
    radii = np.array(draw(st.lists(st.floats(4.0, 30.0), min_size=5, max_size=24)))
    radii[0] *= 1.0 - draw(st.floats(0.0, 0.2))
    turn = np.arange(len(radii)) * (2 * math.pi / len(radii))
    ring = radii[:, None] * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    shape = Polygon(ring)
    for east, north in draw(st.lists(st.tuples(st.floats(-9, 9), st.floats(-9, 9)), max_size=3)):
        yard = shapely.affinity.rotate(shapely.box(-1.5, -1, 1.5, 1), draw(st.floats(0, 90)))
        yard = shapely.affinity.translate(yard, east, north)
        if shape.buffer(-0.3).contains(yard):
            shape = shape.difference(yard)
    return shape


@given(_outlines())
def test_pieces_are_convex_and_keep_the_silhouette(shape):
    holes = tuple(np.array(hole.coords)[:-1] for hole in shape.interiors)
    _assert_silhouette_kept(shape, convex_parts(np.array(shape.exterior.coords)[:-1], holes))


@given(st.lists(st.tuples(st.integers(0, 12), st.integers(0, 12)), min_size=3, max_size=12))
def test_any_ring_is_covered_as_its_mended_self(corners):
    ring = np.array(corners, dtype=np.float64)
    whole = shapely.make_valid(Polygon(ring))
    areas = [p for p in shapely.get_parts(whole) if p.geom_type in ("Polygon", "MultiPolygon")]
    covered = shapely.union_all([Polygon(p).buffer(1e-3) for p in convex_parts(ring)])
    slack = COLLISION_TOLERANCE_M + 2e-3
    mended = shapely.union_all(areas)
    assert covered.difference(mended.buffer(slack)).area < 1e-3
    assert mended.buffer(-slack).difference(covered).area < 1e-3


def test_a_self_crossing_footprint_still_has_pieces():
    bow = np.array([[0.0, 0], [10, 10], [10, 0], [0, 10]])
    assert _area(convex_parts(bow)) == pytest.approx(50.0, rel=0.05)
