"""In which country a place lies, and on which side is driven there."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import NamedTuple

import msgspec
import numpy as np
import numpy.typing as npt
import shapely

from foretwin.contracts.arrays import Array
from foretwin.contracts.world import DrivingSide

OUTLINES = Path(__file__).with_name("outlines.geojson")
"""Outlines of 243 countries and territories in degrees, made for editors of OpenStreetMap and
merged by code and driving side (the file names source and licence). Inland borders follow the true
ones within some hundred metres, less where nobody lives; they reach out over the sea, so that
harbours and bridges lie inside."""


class CountryPlace(NamedTuple):
    """A country or territory by its code of ISO 3166-1, and the side on which it drives."""

    code: str
    driving_side: DrivingSide


NOWHERE = CountryPlace("", "right")
"""Where no country is: the open sea."""


class _Feature(msgspec.Struct, frozen=True):
    properties: dict[str, str]
    bbox: tuple[float, float, float, float]
    geometry: msgspec.Raw


class _Outlines(msgspec.Struct, frozen=True):
    features: tuple[_Feature, ...]


def places_of(lat_lon_deg: Array) -> tuple[CountryPlace, ...]:
    """Return the country of each of N positions (N, 2); one on a border belongs to either side."""
    found: list[CountryPlace] = [NOWHERE] * len(lat_lon_deg)
    if not found:
        return ()
    # Half a degree more, so that no position lies on the edge of what is cut out.
    low, high = np.floor(lat_lon_deg.min(axis=0) - 0.5), np.ceil(lat_lon_deg.max(axis=0) + 0.5)
    near = _near(*low.tolist(), *high.tolist())
    open_rows = np.arange(len(found))
    for place, outline in near:
        at = lat_lon_deg[open_rows]
        inside: npt.NDArray[np.bool_] = shapely.contains_xy(outline, at[:, 1], at[:, 0])
        for row in open_rows[inside].tolist():
            found[row] = place
        open_rows = open_rows[~inside]
        if not len(open_rows):
            break
    return tuple(found)


def place_at(lat_deg: float, lon_deg: float) -> CountryPlace:
    """Return the country at a position."""
    return places_of(np.array([[lat_deg, lon_deg]]))[0]


@cache
def _near(
    south: float, west: float, north: float, east: float
) -> tuple[tuple[CountryPlace, shapely.Geometry], ...]:
    """Return what lies within a box of whole degrees, each cut out of its country."""
    box = shapely.box(west, south, east, north)
    found = []
    for feature in _file().features:
        w, s, e, n = feature.bbox
        if w <= east and e >= west and s <= north and n >= south:
            part = shapely.intersection(shapely.from_geojson(bytes(feature.geometry)), box)
            if not part.is_empty:
                shapely.prepare(part)
                side: DrivingSide = (
                    "left" if feature.properties["driving_side"] == "left" else "right"
                )
                found.append((CountryPlace(feature.properties["code"], side), part))
    return tuple(found)


@cache
def _file() -> _Outlines:
    return msgspec.json.decode(OUTLINES.read_bytes(), type=_Outlines)
