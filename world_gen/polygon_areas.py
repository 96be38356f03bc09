"""Many lines and polygons at once, and how polygons become areas of a World.

Areas have rings counter-clockwise, in millimetres.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import shapely
from shapely import GeometryType
from shapely.geometry import Polygon

from foretwin.contracts.arrays import Array
from foretwin.contracts.provenance import Provenance
from foretwin.contracts.world import Area
from foretwin.geometry.polyline_batch import Polylines

GRID_M = 0.001
"""Worlds are written in millimetres: areas lie on that grid, so that rounding breaks nothing."""
Outlined = Sequence[tuple[Array, Sequence[Array]]]
"""Polygons as an outline (N, 2) and holes each."""


def lines_of(polylines: Sequence[Array]) -> np.ndarray:
    """Return shapely's lines of polylines (N, 2), made from one array of coordinates."""
    joined = Polylines.of(polylines)
    lines: np.ndarray = shapely.linestrings(joined.xy_m, indices=joined.line)
    return lines


def polygons_of_rings(rings: Sequence[Array]) -> np.ndarray:
    """Return valid polygons, one for each ring (N, 2) that need not be closed or simple."""
    found = polygons_from([(ring, ()) for ring in rings])
    bad = ~shapely.is_valid(found)
    # A bend tighter than the road is wide folds its inner edge.
    found[bad] = shapely.buffer(found[bad], 0.0)
    return found


def polygons_from(outlines: Outlined) -> np.ndarray:
    """Return polygons of outlines and holes, valid or not, made from one array of coordinates."""
    rings = Polylines.of([ring for outline, holes in outlines for ring in (outline, *holes)])
    made = shapely.linearrings(rings.xy_m, indices=rings.line)
    owner = np.repeat(np.arange(len(outlines)), [1 + len(holes) for _, holes in outlines])
    polygons: np.ndarray = shapely.polygons(made, indices=owner)
    return polygons


def cut_out(shapes: np.ndarray, others: np.ndarray, row: np.ndarray, other: np.ndarray) -> None:
    """Take others out of shapes, in place, by pairs of rows; `row` ascends.

    Shape by shape would take a call each: in round k every shape loses its k-th neighbour.
    """
    turn = np.arange(len(row)) - np.searchsorted(row, row)
    for k in range(int(turn.max(initial=-1)) + 1):
        now = turn == k
        shapes[row[now]] = shapely.difference(shapes[row[now]], others[other[now]])


def rings_of(polygons: np.ndarray) -> list[list[Array]]:
    """Return of each polygon its outline (N, 2), counter-clockwise, then its holes, rounded."""
    rings, owner = shapely.get_rings(shapely.orient_polygons(polygons), return_index=True)
    points = np.round(shapely.get_coordinates(rings), 3)
    ends = [0, *np.cumsum(shapely.get_num_coordinates(rings)).tolist()]
    found: list[list[Array]] = [[] for _ in polygons]
    for k, (begin, end) in zip(owner.tolist(), pairwise(ends), strict=True):
        found[k].append(points[begin : end - 1])
    return found


def area_of(name: str, polygon: Polygon) -> Area:
    """Return a polygon as an area of the World."""
    ((outline, *holes),) = rings_of(np.array([polygon], dtype=object))
    return Area(id=name, outline=outline, holes=tuple(holes))


def areas_of(
    names: Sequence[str],
    shapes: np.ndarray,
    *,
    smallest_m2: float,
    sources: Sequence[Provenance] | None = None,
) -> list[list[Area]]:
    """Return for each shape its polygons larger than `smallest_m2`, in a fixed order.

    The largest comes first and bears the shape's name; others are named `NAME-1` and so on.
    """
    parts, owner = shapely.get_parts(shapes, return_index=True)
    size = shapely.area(parts)
    keep = (shapely.get_type_id(parts) == GeometryType.POLYGON) & (size > smallest_m2)
    parts, owner, size = parts[keep], owner[keep], size[keep]
    order = np.lexsort((*shapely.bounds(parts).T[::-1], -np.round(size, 3), owner))
    found: list[list[Area]] = [[] for _ in names]
    for k, (outline, *holes) in zip(owner[order].tolist(), rings_of(parts[order]), strict=True):
        name = f"{names[k]}-{len(found[k])}" if found[k] else names[k]
        source: Provenance = "inferred" if sources is None else sources[k]
        found[k].append(Area(id=name, outline=outline, holes=tuple(holes), source=source))
    return found
