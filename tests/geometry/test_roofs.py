"""Roofs over outlines: heights by form, closed gables, and that nothing is left open."""

import math
from typing import get_args

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from foretwin.contracts.beside_road import RoofForm
from foretwin.geometry.roofs import RoofMesh, roof_mesh

HOUSE = np.array([[0.0, 0.0], [12.0, 0.0], [12.0, 8.0], [0.0, 8.0]])


def height_at(mesh: RoofMesh, x: float, y: float) -> float:
    """Return how high the roof stands over a point; its gables stand upright and do not count."""
    highest = -math.inf
    for a, b, c in mesh.points[mesh.triangles]:
        base = np.column_stack([b[:2] - a[:2], c[:2] - a[:2]])
        if abs(np.linalg.det(base)) < 1e-9:
            continue
        s, t = np.linalg.solve(base, [x - a[0], y - a[1]])
        if min(s, t, 1.0 - s - t) >= -1e-6:
            highest = max(highest, a[2] + s * (b[2] - a[2]) + t * (c[2] - a[2]))
    return float(highest)


@pytest.mark.parametrize(
    ("form", "corner_m", "side_m", "end_m", "middle_m"),
    [
        # corner, half way in from the long side, middle of the short side, middle
        ("gabled", 5.0, 6.5, 8.0, 8.0),
        ("hipped", 5.0, 6.5, 5.0, 8.0),
        ("half_hipped", 5.0, 6.5, 6.5, 8.0),
        ("pyramidal", 5.0, 6.5, 5.0, 8.0),
        ("skillion", 8.0, 7.25, 6.5, 6.5),
        ("gambrel", 5.0, 7.1, 8.0, 8.0),
        ("round", 5.0, 5.0 + 3.0 * math.sqrt(0.75), 8.0, 8.0),
    ],
)
def test_a_roof_stands_as_high_as_its_form_says(
    form: RoofForm, corner_m: float, side_m: float, end_m: float, middle_m: float
) -> None:
    mesh = roof_mesh(HOUSE, form=form, ridge_rad=0.0, eaves_m=5.0, top_m=8.0)
    assert height_at(mesh, 0.01, 0.01) == pytest.approx(corner_m, abs=0.2)
    assert height_at(mesh, 6.0, 2.0) == pytest.approx(side_m, abs=0.05)
    assert height_at(mesh, 0.001, 4.0) == pytest.approx(end_m, abs=0.05)
    assert height_at(mesh, 6.0, 4.0) == pytest.approx(middle_m, abs=0.01)


def test_hips_rise_as_fast_as_the_sides() -> None:
    mesh = roof_mesh(HOUSE, form="hipped", ridge_rad=0.0, eaves_m=0.0, top_m=4.0)
    assert height_at(mesh, 2.0, 4.0) == pytest.approx(height_at(mesh, 6.0, 2.0), abs=1e-3)
    # Across the longer side the roof is a tent whose hips meet in a ridge along y.
    turned = roof_mesh(HOUSE, form="hipped", ridge_rad=math.pi / 2.0, eaves_m=0.0, top_m=4.0)
    assert height_at(turned, 6.0, 4.0) == pytest.approx(4.0, abs=1e-3)
    assert turned.points[:, 2].max() == pytest.approx(4.0, abs=1e-9)


def test_a_mansard_is_steep_first_and_a_dome_round() -> None:
    mansard = roof_mesh(HOUSE, form="mansard", ridge_rad=0.0, eaves_m=0.0, top_m=4.0)
    assert height_at(mansard, 6.0, 1.2) == pytest.approx(3.0, abs=0.01)
    assert height_at(mansard, 1.2, 4.0) == pytest.approx(3.0, abs=0.01)
    dome = roof_mesh(HOUSE, form="dome", ridge_rad=0.0, eaves_m=0.0, top_m=4.0)
    assert height_at(dome, 6.0, 2.0) == pytest.approx(4.0 * math.sqrt(0.75), abs=0.15)
    assert height_at(dome, 9.0, 4.0) == pytest.approx(4.0 * math.sqrt(0.75), abs=0.15)


outlines = st.builds(
    lambda radii, turn: np.array(
        [
            (
                r * math.cos(turn + k * math.tau / len(radii)),
                r * math.sin(turn + k * math.tau / len(radii)),
            )
            for k, r in enumerate(radii)
        ]
    ),
    st.lists(st.floats(3.0, 20.0), min_size=4, max_size=9),
    st.floats(0.0, 6.0),
)


@given(outlines, st.sampled_from(get_args(RoofForm)), st.floats(0.0, 3.2), st.booleans())
def test_a_roof_covers_its_outline_and_is_closed_to_the_eaves(
    outline: np.ndarray, form: RoofForm, ridge_rad: float, with_hole: bool
) -> None:
    holes = [np.array([[0.5, 0.5], [-0.5, 0.5], [-0.5, -0.5], [0.5, -0.5]])] if with_hole else []
    mesh = roof_mesh(outline, holes, form=form, ridge_rad=ridge_rad, eaves_m=4.0, top_m=7.0)
    assert mesh.points[:, 2].min() >= 4.0 - 1e-9
    assert mesh.points[:, 2].max() <= 7.0 + 1e-9
    a, b, c = (mesh.points[mesh.triangles[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    # Seen from above the slopes cover the outline once: none is turned over, gables stand upright.
    assert (normal[:, 2] >= -1e-6).all()
    shape = shapely.Polygon(outline, holes)
    assert normal[:, 2].sum() / 2.0 == pytest.approx(shape.area, rel=2e-3, abs=0.02)
    # What is open lies at the eaves: every edge above them belongs to two triangles.
    edges: dict[frozenset[int], int] = {}
    for triangle in mesh.triangles.tolist():
        for k in range(3):
            edge = frozenset((triangle[k], triangle[(k + 1) % 3]))
            edges[edge] = edges.get(edge, 0) + 1
    top = [e for e, n in edges.items() if n == 1 and mesh.points[list(e), 2].min() > 4.2]
    upright = [e for e in top if np.ptp(mesh.points[list(e), :2], axis=0).max() > 0.05]
    assert not upright
