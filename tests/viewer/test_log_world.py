"""A World's geometry as meshes and lines."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from foretwin.contracts.frames import target_from_source
from foretwin.viewer.log_world import (
    BUILDING,
    rows_of_world,
    world_centre,
    zebra_stripes,
)
from foretwin.viewer.meshes import Polygon, flat_mesh, prism_mesh, triangulate
from tests.viewer import scene

COVERS = ("foretwin.viewer.meshes",)

RADII = st.lists(st.floats(2.0, 30.0), min_size=3, max_size=24)


def _star(radii: list[float]) -> np.ndarray:
    angle = np.linspace(0.0, 2.0 * np.pi, len(radii), endpoint=False)
    return np.array(radii)[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])


def _areas(corners: np.ndarray) -> np.ndarray:
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) / 2.0


@given(radii=RADII, clockwise=st.booleans(), with_hole=st.booleans())
def test_triangles_fill_the_polygon_and_look_up(
    radii: list[float], clockwise: bool, with_hole: bool
) -> None:
    outline = _star(radii)[:: -1 if clockwise else 1]
    holes = (0.4 * _star([1.0] * 5),) if with_hole and len(radii) > 3 else ()
    areas = _areas(triangulate([Polygon(outline, holes)]).corners_m)
    assert (areas > 0.0).all()
    assert areas.sum() == pytest.approx(shapely.Polygon(outline, holes).area, rel=1e-9)


def test_a_self_crossing_outline_is_repaired_and_a_line_left_out() -> None:
    bow = np.array([[0.0, 0.0], [2.0, 2.0], [2.0, 0.0], [0.0, 2.0]])
    line = np.array([[0.0, 0.0], [5.0, 0.0], [9.0, 0.0]])
    triangles = triangulate([Polygon(line), Polygon(bow), Polygon(line[:2])])
    assert set(triangles.owner.tolist()) == {1}
    assert _areas(triangles.corners_m).sum() == pytest.approx(2.0)


@given(radii=RADII, clockwise=st.booleans(), height_m=st.floats(1.0, 50.0))
def test_every_face_of_a_prism_looks_outward(
    radii: list[float], clockwise: bool, height_m: float
) -> None:
    outline = _star(radii)[:: -1 if clockwise else 1]
    mesh = prism_mesh(
        [Polygon(outline)], low_m=[0.0], high_m=[height_m], colours=[BUILDING["tagged"]]
    )
    faces = mesh.vertices_m[mesh.triangles].astype(np.float64)
    normals = np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])
    assert (np.sum(normals * mesh.normals[mesh.triangles[:, 0]], axis=1) > 0.0).all()
    # The divergence theorem: walls and roof (the missing floor lies at z = 0) enclose the volume.
    volume = np.sum(normals * faces.mean(axis=1)) / 6.0
    assert volume == pytest.approx(shapely.Polygon(outline).area * height_m, rel=1e-4)


def test_a_crossing_eight_metres_long_has_eight_stripes_inside_it() -> None:
    stripes = zebra_stripes(np.array([[0.0, 0.0], [0.0, 8.0]]), width_m=3.0)
    assert len(stripes) == 8
    every = np.concatenate(stripes)
    assert every[:, 0].min() == -1.5
    assert every[:, 0].max() == 1.5
    assert every[:, 1].min() >= 0.0
    assert every[:, 1].max() <= 8.0


def test_a_world_is_moved_into_the_drive_frame() -> None:
    world = scene.junction()
    rows = rows_of_world(world, drive_frame=scene.DRIVE_FRAME, drive_ns=5)
    by_path = {row.path.removeprefix(f"world/map/{world.id}/"): row for row in rows}
    points = np.array(
        by_path["stop_lines"].components.strips.as_arrow_array().to_pylist()  # type: ignore[attr-defined]
    )[0]
    stop = world.stop_lines[0].ends
    wanted = target_from_source(scene.DRIVE_FRAME, world.frame, stop, np.zeros(2)).xy_m
    np.testing.assert_allclose(points[:, :2], wanted, atol=1e-4)
    assert all(row.drive_ns == 5 and row.lasting for row in rows)
    centre = world_centre(world, drive_frame=scene.DRIVE_FRAME)
    assert 150.0 < np.hypot(*centre) < 300.0


def test_flat_areas_lie_at_their_height() -> None:
    mesh = flat_mesh([Polygon(_star([3.0] * 6))], height_m=0.12, colour=(1, 2, 3))
    np.testing.assert_allclose(mesh.vertices_m[:, 2], 0.12, atol=1e-6)
    assert (mesh.colours == (1, 2, 3)).all()
