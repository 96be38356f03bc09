"""Footprints cut into few convex pieces, since a mesh collides as its convex hull.

Most footprints are rectangles put together: a piece that is a rectangle, within the tolerance, is
marked as one, since a box costs a simulation a tenth of what a mesh does.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import shapely

from foretwin.contracts.arrays import Array
from foretwin.geometry.reflex_cuts import cut_at_reflex_corners, nearly_the_same, polygons_of
from foretwin.world_gen.buildings.footprints import FOOTPRINT_TOLERANCE_M, SILHOUETTE_TOLERANCE_M
from foretwin.world_gen.polygon_areas import Outlined, polygons_from

COLLISION_TOLERANCE_M = SILHOUETTE_TOLERANCE_M - FOOTPRINT_TOLERANCE_M
"""How far convex parts may move a silhouette that the footprint has moved already."""
SIMPLIFY_M, HULL_M, BOX_M = (share * COLLISION_TOLERANCE_M for share in (0.25, 0.15, 0.6))
"""Most of it goes into rectangles, since those save most; the shares together are 1."""
_MIN_AREA_M2 = 0.01

Geometries = npt.NDArray[np.object_]
Indices = npt.NDArray[np.intp]


class ConvexParts(NamedTuple):
    """Convex pieces (K,) of polygons: rings (N, 2) counter-clockwise, and whose piece each is.

    Where `is_box`, the piece is a rectangle of `half_m` (K, 2) about `centre_m` (K, 2), its first
    side along `yaw_rad` (K,), and its ring has those four corners.
    """

    owner: Indices
    rings: list[Array]
    is_box: npt.NDArray[np.bool_]
    centre_m: Array
    half_m: Array
    yaw_rad: Array


def convex_cover(outlines: Outlined) -> ConvexParts:
    """Return convex pieces that together cover polygons, each an outline (N, 2) and its holes.

    No point of a silhouette moves by more than `COLLISION_TOLERANCE_M`: outlines are simplified,
    pieces taken for their convex hulls, and those for rectangles, each within its share of it.
    Self-crossing outlines are mended.
    """
    shapes, owner = sound_polygons(polygons_from(outlines))
    simple = shapely.simplify(shapes, SIMPLIFY_M, preserve_topology=True)
    counts = shapely.get_num_coordinates(simple), shapely.get_num_coordinates(shapes)
    changed = np.flatnonzero(counts[0] != counts[1])
    # What is empty, or crosses itself now, stays as it was.
    worse = changed[~shapely.is_valid(simple[changed]) | shapely.is_empty(simple[changed])]
    simple[worse] = shapes[worse]
    pieces, of = cut_at_reflex_corners(simple, HULL_M)
    keep = shapely.area(pieces) >= _MIN_AREA_M2
    pieces, of = pieces[keep], of[keep]
    boxes = shapely.oriented_envelope(pieces)
    is_box = shapely.get_type_id(boxes) == shapely.GeometryType.POLYGON
    is_box[is_box] = nearly_the_same(boxes[is_box], pieces[is_box], BOX_M, convex=True)
    return _parts_of(owner[of], np.where(is_box, boxes, pieces), is_box)


def sound_polygons(shapes: Geometries) -> tuple[Geometries, Indices]:
    """Return valid polygons, and of which shape each is."""
    bad = ~shapely.is_valid(shapes)
    if bad.any():
        shapes = shapes.copy()
        shapes[bad] = shapely.make_valid(shapes[bad])
    return polygons_of(shapes, np.arange(len(shapes)))


def _parts_of(owner: Indices, pieces: Geometries, is_box: npt.NDArray[np.bool_]) -> ConvexParts:
    pieces = shapely.orient_polygons(pieces)
    points = shapely.get_coordinates(pieces)
    counts = shapely.get_num_coordinates(pieces)
    ends = np.cumsum(counts)
    begins = ends - counts
    first = np.where(is_box, begins, 0)
    a, b, c = (points[first + k] if len(points) else np.zeros((0, 2)) for k in range(3))
    along, across = b - a, c - b
    order = np.argsort(owner, kind="stable")
    spans = list(zip(begins.tolist(), (ends - 1).tolist(), strict=True))
    return ConvexParts(
        owner=owner[order],
        rings=[points[begin:end] for begin, end in (spans[k] for k in order.tolist())],
        is_box=is_box[order],
        centre_m=((a + c) / 2)[order],
        half_m=np.stack([np.hypot(*along.T), np.hypot(*across.T)], axis=1)[order] / 2,
        yaw_rad=np.arctan2(along[:, 1], along[:, 0])[order],
    )
