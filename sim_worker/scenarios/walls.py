"""The walls of a World, of buildings and others: nothing comes out of them or parks in them."""

from __future__ import annotations

import numpy as np
import shapely

from foretwin.contracts.arrays import Array
from foretwin.contracts.beside_road import ObstacleKind
from foretwin.contracts.world import World
from foretwin.geometry.frenet_path import FrenetPath

_WALLS: frozenset[ObstacleKind] = frozenset(("wall", "fence", "hedge", "shelter", "guard_rail"))


class Walls:
    """An index of a World's buildings, walls, fences and hedges; ways lead past trees and posts."""

    def __init__(self, world: World) -> None:
        walls = [shapely.Polygon(o.outline, o.holes) for o in world.obstacles if o.kind in _WALLS]
        walls += [shapely.Polygon(b.outline) for b in world.buildings]
        self._tree = shapely.STRtree(walls)

    def meet(self, shape: shapely.Geometry) -> bool:
        """Return whether a shape touches one."""
        return len(self._tree.query(shape, "intersects")) > 0

    def block(
        self, path: FrenetPath, from_m: float, to_m: float, *, width_m: float, left_m: float = 0.0
    ) -> bool:
        """Return whether what is so wide touches one on its way between two arc lengths, `left_m`
        to the left of the path."""
        arcs = np.linspace(from_m, to_m, max(2, int(to_m - from_m) + 1))
        line: Array = path.point_at(arcs, left_m)
        return self.meet(shapely.LineString(line).buffer(width_m / 2.0, cap_style="flat"))
