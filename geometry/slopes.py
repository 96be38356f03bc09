"""How steep the road under a car is, by where it is and where it heads.

Roads are straight across: a car that stands square to its lane feels no slope.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.codec import read_message
from foretwin.contracts.elevation import RoadSlopes
from foretwin.contracts.world import Connection, Lane, World
from foretwin.geometry.world_heights import heights_of

SPACING_M = 4.0
"""Of the places at which a World's lanes are asked."""
_NEAR_M = 20.0
"""Beyond, no road says anything: there it is level."""
_SQUARE_M = 8.0
"""A road square to the car counts as so much farther away: what passes over or under does."""


class Slopes:
    """The slopes of roads, found by the nearest of them that leads where the car heads."""

    def __init__(self, roads: RoadSlopes) -> None:
        # Imported here: most Worlds are flat.
        from scipy.spatial import cKDTree

        self.grade_std = roads.grade_std
        self._rise = roads.direction * roads.grade[:, None]
        # Of twice its angle, a direction and its opposite are the same.
        x, y = roads.direction.T
        twice = np.column_stack([x * x - y * y, 2.0 * x * y])
        self._tree = cKDTree(np.column_stack([roads.xy_m, 0.5 * _SQUARE_M * twice]))

    def grade_at(self, xy_m: Array, heading: Array) -> Array:
        """Return grades (S,), rise over run, at places (2, S) towards unit headings (2, S)."""
        cos, sin = heading
        ahead = 0.5 * _SQUARE_M * np.array([cos * cos - sin * sin, 2.0 * cos * sin])
        far, near = self._tree.query(np.concatenate([xy_m, ahead]).T, distance_upper_bound=_NEAR_M)
        rise = self._rise[np.minimum(near, len(self._rise) - 1)]
        return np.where(np.isfinite(far), rise[:, 0] * cos + rise[:, 1] * sin, 0.0)


def read_slopes(file: Path) -> Slopes:
    """Read slopes as a drive keeps them; raises SchemaMismatch naming the file."""
    return Slopes(read_message(file, RoadSlopes))


def slopes_of(world: World | None) -> Slopes | None:
    """Return the slopes of a World's lanes, None where it is flat."""
    roads = None if world is None else road_slopes(world)
    return None if roads is None else Slopes(roads)


def road_slopes(world: World) -> RoadSlopes | None:
    """Return how a World's lanes and connections climb, None where it is flat."""
    heights = heights_of(world)
    if heights is None:
        return None
    parts: list[Lane | Connection] = [*world.lanes, *world.connections]
    found = [heights.slope(part, spacing_m=SPACING_M) for part in parts]
    if not found:
        return None
    return RoadSlopes(
        xy_m=np.concatenate([one.xy_m for one in found]),
        direction=np.concatenate([one.direction for one in found]),
        grade=np.concatenate([one.grade for one in found]),
        grade_std=heights.elevation.grade_std,
    )
