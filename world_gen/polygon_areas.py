"""How polygons become areas of a World: rings counter-clockwise, in millimetres, many at once."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import shapely
from shapely.geometry import Polygon

from foretwin.contracts.arrays import Array
from foretwin.contracts.provenance import Provenance
from foretwin.contracts.world import Area

_POLYGON = 3


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
    keep = (shapely.get_type_id(parts) == _POLYGON) & (size > smallest_m2)
    parts, owner, size = parts[keep], owner[keep], size[keep]
    order = np.lexsort((*shapely.bounds(parts).T[::-1], -np.round(size, 3), owner))
    found: list[list[Area]] = [[] for _ in names]
    for k, (outline, *holes) in zip(owner[order].tolist(), rings_of(parts[order]), strict=True):
        name = f"{names[k]}-{len(found[k])}" if found[k] else names[k]
        source: Provenance = "inferred" if sources is None else sources[k]
        found[k].append(Area(id=name, outline=outline, holes=tuple(holes), source=source))
    return found
