"""What stands in a World: nothing comes out of it, parks in it or drives through it."""

from __future__ import annotations

import msgspec
import numpy as np
import shapely

from foretwin.contracts.arrays import Array
from foretwin.contracts.beside_road import ObstacleKind
from foretwin.contracts.world import World
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.geometry.rectangles import Rectangles, corners
from foretwin.world_gen.export.solids import stops_cars

_WALLS: frozenset[ObstacleKind] = frozenset(("wall", "fence", "hedge", "shelter", "guard_rail"))
_BELOW_M = 3.0
"""Buildings that begin higher are passed below, as is a passage. Chosen: above a lorry's 2.8 m."""
_BESIDE_HOUSES_M = 0.75
"""Room on either side of a vehicle that drives: 0.25 m in which it moves and 0.5 m of safety (RASt
06, 4.2)."""


class Walls:
    """An index of a World's buildings, walls, fences and hedges, which stop all; trees, posts and
    the middles of rings stop vehicles, and who walks passes by them.

    Houses are as the map has them, also where they were cut back for lanes.
    """

    def __init__(self, world: World) -> None:
        obstacles = [shapely.Polygon(o.outline, o.holes) for o in world.obstacles]
        stops_all = [o.kind in _WALLS for o in world.obstacles]
        walls = [o for o, stops in zip(obstacles, stops_all, strict=True) if stops]
        low = [building for building in world.buildings if building.min_height_m < _BELOW_M]
        houses = [shapely.Polygon(building.outline, building.holes) for building in low]
        if world.cut_away is not msgspec.UNSET:
            houses += [shapely.Polygon(area.outline, area.holes) for area in world.cut_away]
        posts = [o for o, stops in zip(obstacles, stops_all, strict=True) if not stops]
        posts += [shapely.Polygon(i.outline, i.holes) for i in world.islands if stops_cars(i)]
        self._tree = shapely.STRtree(walls + houses)
        self._posts, self._houses = shapely.STRtree(posts), shapely.STRtree(houses)

    def meet(self, shape: shapely.Geometry) -> bool:
        """Return whether a shape touches what stops all."""
        return len(self._tree.query(shape, "intersects")) > 0

    def stop(self, boxes: Rectangles) -> bool:
        """Return whether any of boxes (N,) of a vehicle touches what stops it."""
        outlines = shapely.polygons(corners(boxes))
        trees = self._tree, self._posts
        return any(len(tree.query(outlines, "intersects")[0]) for tree in trees)

    def first_met(self, boxes: Rectangles, *, drives: bool) -> int | None:
        """Return the first of boxes (N,) that touches what stops who walks or cycles, or a vehicle
        that drives, which needs room beside houses."""
        outlines = shapely.polygons(corners(boxes))
        met = self._tree.query(outlines, "intersects")[0]
        if drives:
            wider = boxes._replace(width_m=boxes.width_m + 2.0 * _BESIDE_HOUSES_M)
            narrow = self._houses.query(shapely.polygons(corners(wider)), "intersects")[0]
            met = np.concatenate([met, narrow, self._posts.query(outlines, "intersects")[0]])
        return int(met.min()) if len(met) else None

    def block(
        self, path: FrenetPath, from_m: float, to_m: float, *, width_m: float, left_m: float = 0.0
    ) -> bool:
        """Return whether what is so wide touches one on its way between two arc lengths, `left_m`
        to the left of the path."""
        arcs = np.linspace(from_m, to_m, max(2, int(to_m - from_m) + 1))
        line: Array = path.point_at(arcs, left_m)
        return self.meet(shapely.LineString(line).buffer(width_m / 2.0, cap_style="flat"))
