"""Pieces of paved ground while a World is being built, and how a polygon becomes its Area."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import shapely
from shapely.geometry import Polygon
from shapely.geometry.polygon import orient

from contracts.arrays import Array
from contracts.world import Area
from world_gen.clusters import Cluster

GRID_M = 0.001
"""Worlds are written in millimetres: areas lie on that grid, so that rounding breaks nothing."""


class Paved(NamedTuple):
    """Pieces of paved ground as shapely polygons: of roads, and of places where they meet.

    `roads[i]` belongs to the World's i-th road, `places[k]` to the cluster `place_of[k]`.
    """

    roads: np.ndarray
    places: np.ndarray
    place_of: tuple[Cluster, ...]


def area_of(name: str, polygon: Polygon) -> Area:
    """Return a polygon as an area of the World, counter-clockwise."""
    ring = orient(polygon)
    return Area(
        id=name,
        outline=_coordinates(ring.exterior),
        holes=tuple(_coordinates(hole) for hole in ring.interiors),
    )


def _coordinates(ring: shapely.LinearRing) -> Array:
    points: Array = np.round(shapely.get_coordinates(ring)[:-1], 3)
    return points
