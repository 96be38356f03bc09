"""Boxes in degrees around maps: that of the roads, and whether a header's can be believed."""

from __future__ import annotations

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import GeoPoint
from foretwin.world_gen.osm.osm_map import LatLonBounds, MapError

WIDEST_MAP_DEG = 60.0
"""One plane of metres serves no more of the Earth than this."""
EMPTY_TIMES, EMPTY_DEG = 3.0, 0.1
"""A map's box may be so many times as wide as its roads, and 10 km more: empty land, or the sea."""


def bounds_of(file: str, lat_lon_deg: Array, *, widest_deg: float = WIDEST_MAP_DEG) -> LatLonBounds:
    """Return the box around positions (N, 2); across the antimeridian where that is narrower.

    Raises `MapError` where it is too wide for one plane.
    """
    lat, lon = lat_lon_deg[:, 0], lat_lon_deg[:, 1]
    west, east = float(lon.min()), float(lon.max())
    if east - west > 180.0:
        beyond = np.where(lon < 0.0, lon + 360.0, lon)
        if np.ptp(beyond) < east - west:
            west, east = float(beyond.min()), float(beyond.max()) - 360.0
    box = LatLonBounds(float(lat.min()), west, float(lat.max()), east)
    if reach_deg(box) > widest_deg:
        width_deg = (east - west) % 360.0
        raise MapError(
            f"{file}: its roads reach over {width_deg:.0f} by {box.north - box.south:.0f} degrees; "
            f"cut out a region of less than {widest_deg:.0f}"
        )
    return box


def believed_bounds(
    declared: LatLonBounds | None, roads: LatLonBounds
) -> tuple[LatLonBounds, list[str]]:
    """Return the box that a map's header declares, where it fits the box around its roads.

    Else that of the roads, and a note. Roads may reach beyond a declared box, since they are kept
    whole, and it may hold empty land or sea, but not none of them, and not the quarter of the Earth
    that some tools write.
    """
    if declared is None:
        return roads, []
    apart = declared.south > roads.north or roads.south > declared.north
    east_of, beyond = (declared.west - roads.west) % 360.0, (roads.west - declared.west) % 360.0
    apart |= east_of > _width_deg(roads) and beyond > _width_deg(declared)
    spans = zip(_spans_deg(declared), _spans_deg(roads), strict=True)
    wide = any(mine > EMPTY_TIMES * its + EMPTY_DEG for mine, its in spans)
    if not apart and not wide:
        return declared, []
    words = "holds none of its roads" if apart else "is far larger than its roads"
    south, west, north, east = declared
    box = f"{west:g},{south:g},{east:g},{north:g}"
    return roads, [f"the box {box} in the map's header {words}; the roads' own is used"]


def _spans_deg(box: LatLonBounds) -> tuple[float, float]:
    return box.north - box.south, _width_deg(box)


def _width_deg(box: LatLonBounds) -> float:
    return (box.east - box.west) % 360.0 if box.west > box.east else box.east - box.west


def reach_deg(box: LatLonBounds) -> float:
    """Return the longer side of a box; near a pole its width in degrees means nothing."""
    near_pole = max(abs(box.south), abs(box.north)) > 89.0
    return max(0.0 if near_pole else (box.east - box.west) % 360.0, box.north - box.south)


def centre_of(box: LatLonBounds) -> GeoPoint:
    """Return the middle of a box, its longitude within ±180 degrees."""
    width_deg = _width_deg(box)
    middle = box.west + width_deg / 2.0 if box.west > box.east else (box.west + box.east) / 2.0
    return GeoPoint((box.south + box.north) / 2.0, middle - 360.0 if middle > 180.0 else middle)
