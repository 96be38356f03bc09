"""Pieces of paved ground while a World is being built."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from foretwin.world_gen.lanes.legs import Cluster

GRID_M = 0.001
"""Worlds are written in millimetres: areas lie on that grid, so that rounding breaks nothing."""


class Paved(NamedTuple):
    """Pieces of paved ground as shapely polygons: of roads, and of places where they meet.

    `roads[i]` belongs to the World's i-th road, `places[k]` to the cluster `place_of[k]`.
    """

    roads: np.ndarray
    places: np.ndarray
    place_of: tuple[Cluster, ...]
