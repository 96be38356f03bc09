"""Triangles fill the areas that they stand for, and are seen from above."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from foretwin.geometry.triangles import joined, triangulated, twice_areas_m2, upward


@given(
    radii=st.lists(st.floats(1.0, 9.0), min_size=5, max_size=12),
    clockwise=st.booleans(),
    hole=st.booleans(),
)
def test_triangles_of_a_star_have_its_area_and_its_corners(radii, clockwise, hole):
    angle = np.linspace(0.0, 2.0 * np.pi, len(radii), endpoint=False)[:: -1 if clockwise else 1]
    ring = np.array(radii)[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    holes = [0.05 * ring] if hole else []
    star = shapely.Polygon(ring, holes)
    found = triangulated(np.array([shapely.Point(50.0, 0.0).buffer(1.0), star]))
    mine = found.corners_m[found.owner == 1]

    assert (twice_areas_m2(found.corners_m) > 0.0).all()
    assert twice_areas_m2(mine).sum() / 2.0 == pytest.approx(star.area)
    mesh = joined(mine, sliver_m2=0.0)
    assert len(mesh.xy_m) == len(radii) * (1 + hole)
    assert twice_areas_m2(mesh.xy_m[mesh.triangles]).sum() / 2.0 == pytest.approx(
        star.area, rel=1e-3
    )


def test_triangles_are_turned_upwards_and_slivers_left_out():
    points = np.array([[0.0, 0.0, 3.0], [4.0, 0.0, 3.0], [0.0, 4.0, 9.0], [2.0, 0.00001, 3.0]])
    faces = np.array([[0, 2, 1], [0, 1, 3]])

    np.testing.assert_array_equal(upward(points, faces, sliver_m2=1e-3), [[1, 2, 0]])
