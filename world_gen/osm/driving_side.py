"""On which side of the road a country drives: by position, and by tags where they are many."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path

import numpy as np
import numpy.typing as npt
import shapely

from foretwin.contracts.arrays import Array
from foretwin.contracts.world import DrivingSide

LEFT_HAND_TRAFFIC = Path(__file__).with_name("left_hand_traffic.geojson")
"""Rough outlines of where traffic keeps left; they follow land borders within some tens of
kilometres."""
CELL_DEG = 0.02
"""About two kilometres: a grid that does not depend on where a map is cut."""
LEAST_SHARE, LEAST_M = 0.1, 1000.0
"""Of the metres of road in a cell, and so many: tags on as much are taken for what holds there, on
less for what holds on their own way alone. These numbers are ours, by default: a bridge or a car
park that is driven on the other side is less, and where whole towns lie beyond an outline their
main roads are more."""

Tags = Mapping[str, str]


def driving_sides(
    tags: Sequence[Tags], lat_lon_deg: Array, length_m: Array
) -> tuple[DrivingSide, ...]:
    """Return the side on which each of N roads is driven.

    `lat_lon_deg` (N, 2) is where each begins, `length_m` (N,) how long it is. A `driving_side` tag
    holds for its own road. Roads without one are driven as the outlines say, or as the tags of
    their cell where these are on more metres than those of the other side, and on enough of them.
    """
    left = _keeps_left_at(lat_lon_deg)
    said = [one.get("driving_side") for one in tags]
    tagged_left = np.array([side == "left" for side in said], dtype=bool)
    tagged_right = np.array([side == "right" for side in said], dtype=bool)
    if tagged_left.any() or tagged_right.any():
        square = np.floor(lat_lon_deg / CELL_DEG).astype(np.int64)
        cell = np.unique(square, axis=0, return_inverse=True)[1].reshape(-1)
        whole_m, left_m, right_m = (
            np.bincount(cell, weights=length_m * share)
            for share in (1.0, tagged_left, tagged_right)
        )
        enough = np.maximum(left_m, right_m) >= np.maximum(LEAST_SHARE * whole_m, LEAST_M)
        by_tags = (enough & (left_m != right_m))[cell]
        left = np.where(by_tags, (left_m > right_m)[cell], left)
        left = (left | tagged_left) & ~tagged_right
    return tuple("left" if one else "right" for one in left.tolist())


def side_at(lat_deg: float, lon_deg: float) -> DrivingSide:
    """Return the side traffic keeps at a position, by rough outlines."""
    return "left" if _keeps_left_at(np.array([[lat_deg, lon_deg]]))[0] else "right"


def _keeps_left_at(lat_lon_deg: Array) -> npt.NDArray[np.bool_]:
    """Return (N,) whether traffic keeps left at positions (N, 2)."""
    if not len(lat_lon_deg):
        return np.zeros(0, dtype=bool)
    (south, west), (north, east) = lat_lon_deg.min(axis=0), lat_lon_deg.max(axis=0)
    outlines, everywhere = _outlines(), shapely.box(west, south, east, north)
    if not shapely.intersects(outlines, everywhere):
        return np.zeros(len(lat_lon_deg), dtype=bool)
    inside: npt.NDArray[np.bool_] = shapely.contains_xy(
        outlines, lat_lon_deg[:, 1], lat_lon_deg[:, 0]
    )
    return inside


@cache
def _outlines() -> shapely.Geometry:
    outlines = shapely.from_geojson(LEFT_HAND_TRAFFIC.read_text(encoding="utf-8"))
    whole = shapely.union_all(outlines.geoms)
    shapely.prepare(whole)
    return whole
