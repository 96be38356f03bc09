"""Polygons to triangles: flat areas and prisms with one normal per face."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import shapely

from foretwin.contracts.arrays import Array
from foretwin.geometry.reflex_cuts import polygons_of
from foretwin.geometry.triangles import Triangles, triangulated
from foretwin.viewer.colours import Colour


class Polygon(NamedTuple):
    """One polygon in metres: `outline` (N, 2) and holes, no point repeated at the end."""

    outline: Array
    holes: tuple[Array, ...] = ()


class Mesh(NamedTuple):
    """Triangles with their own vertices: all (V, 3) but `triangles` (V / 3, 3)."""

    vertices_m: npt.NDArray[np.float32]
    normals: npt.NDArray[np.float32]
    colours: npt.NDArray[np.uint8]
    triangles: npt.NDArray[np.uint32]


def triangulate(polygons: Sequence[Polygon]) -> Triangles:
    """Return the triangles that fill the polygons; parts without area are left out."""
    usable = [index for index, polygon in enumerate(polygons) if len(polygon.outline) >= 3]
    if not usable:
        return Triangles(np.empty((0, 3, 2)), np.empty(0, dtype=np.intp))
    shapes = np.array(
        [
            shapely.Polygon(
                polygons[index].outline, [hole for hole in polygons[index].holes if len(hole) >= 3]
            )
            for index in usable
        ],
        dtype=object,
    )
    parts, part_of = polygons_of(shapely.make_valid(shapes), np.array(usable))
    found = triangulated(parts)
    return found._replace(owner=part_of[found.owner])


def _signed_area(ring: Array) -> float:
    following = np.roll(ring, -1, axis=0)
    return float(np.sum(ring[:, 0] * following[:, 1] - following[:, 0] * ring[:, 1]) / 2.0)


def _walls(ring: Array, low_m: float, high_m: float) -> tuple[Array, Array]:
    """Return corners (W, 3, 3) and normals (W, 3) of the walls of a counter-clockwise ring."""
    following = np.roll(ring, -1, axis=0)
    along = following - ring
    length = np.hypot(along[:, 0], along[:, 1])
    keep = length > 1e-6
    a, b, along, length = ring[keep], following[keep], along[keep], length[keep]
    low, high = np.full((len(a), 1), low_m), np.full((len(a), 1), high_m)
    a0, b0, b1, a1 = (np.hstack(pair) for pair in ((a, low), (b, low), (b, high), (a, high)))
    corners = np.concatenate([np.stack([a0, b0, b1], axis=1), np.stack([a0, b1, a1], axis=1)])
    outward = np.stack([along[:, 1] / length, -along[:, 0] / length, np.zeros(len(a))], axis=1)
    return corners, np.concatenate([outward, outward])


def _mesh(corners: Array, normals: Array, colours: npt.NDArray[np.uint8]) -> Mesh:
    count = len(corners)
    return Mesh(
        corners.reshape(-1, 3).astype(np.float32),
        np.repeat(normals, 3, axis=0).astype(np.float32),
        np.repeat(colours, 3, axis=0),
        np.arange(3 * count, dtype=np.uint32).reshape(-1, 3),
    )


def flat_mesh(polygons: Sequence[Polygon], *, height_m: float, colour: Colour) -> Mesh:
    """Return the areas as one horizontal mesh at `height_m`."""
    corners = triangulate(polygons).corners_m
    raised = np.concatenate([corners, np.full((*corners.shape[:2], 1), height_m)], axis=2)
    return _mesh(
        raised,
        np.tile([0.0, 0.0, 1.0], (len(raised), 1)),
        np.tile(np.asarray(colour, dtype=np.uint8), (len(raised), 1)),
    )


def prism_mesh(
    polygons: Sequence[Polygon],
    *,
    low_m: Sequence[float],
    high_m: Sequence[float],
    colours: Sequence[Colour],
) -> Mesh:
    """Return upright prisms, walls and roofs, as one mesh; one height range and colour each."""
    heights, shades = np.asarray(high_m, dtype=np.float64), np.asarray(colours, dtype=np.uint8)
    roofs = triangulate(polygons)
    roof_height = np.broadcast_to(heights[roofs.owner][:, None, None], (len(roofs.owner), 3, 1))
    corners = [np.concatenate([roofs.corners_m, roof_height], axis=2)]
    normals = [np.tile([0.0, 0.0, 1.0], (len(roofs.owner), 1))]
    faces = [shades[roofs.owner]]
    for index, polygon in enumerate(polygons):
        for ring, is_hole in [(polygon.outline, False), *((hole, True) for hole in polygon.holes)]:
            if len(ring) < 3:
                continue
            # Walls face outward: along a counter-clockwise outline, a clockwise hole.
            oriented = ring if (_signed_area(ring) > 0.0) != is_hole else ring[::-1]
            wall_corners, wall_normals = _walls(oriented, low_m[index], high_m[index])
            corners.append(wall_corners)
            normals.append(wall_normals)
            faces.append(np.tile(shades[index], (len(wall_corners), 1)))
    return _mesh(np.concatenate(corners), np.concatenate(normals), np.concatenate(faces))
