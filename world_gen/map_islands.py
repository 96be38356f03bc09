"""Traffic islands that the map itself draws (`area:highway=traffic_island`)."""

from __future__ import annotations

import numpy as np
import shapely

from contracts.world import Area
from world_gen.beside_roads import BesideRoads, in_frame
from world_gen.clusters import Surroundings
from world_gen.islands import MIN_ISLAND_M2
from world_gen.osm_map import OsmMap
from world_gen.paved import GRID_M, area_of


def mapped_islands(
    around: Surroundings, osm: OsmMap, beside: BesideRoads, driven: np.ndarray
) -> tuple[Area, ...]:
    """Return them without the ground that lanes and turns sweep (`driven`, polygons)."""
    found: list[Area] = []
    tree: shapely.STRtree | None = None
    for way, xy in zip(beside.islands, in_frame(beside.islands, osm, around.frame), strict=True):
        if len(xy) < 4 or way.nodes[0] != way.nodes[-1] or not around.extent.holds(xy).all():
            continue
        shape = shapely.make_valid(shapely.Polygon(xy))
        tree = tree or shapely.STRtree(driven)
        over = driven[tree.query(shape, predicate="intersects")]
        left = shapely.set_precision(shape.difference(shapely.union_all(over)), GRID_M)
        parts = [
            part
            for part in shapely.get_parts(left)
            if isinstance(part, shapely.Polygon) and part.area >= MIN_ISLAND_M2
        ]
        for i, part in enumerate(sorted(parts, key=lambda p: (-round(p.area, 3), p.bounds))):
            name = f"island:traffic:w{way.id}"
            area = area_of(name if i == 0 else f"{name}-{i}", part)
            found.append(Area(id=area.id, outline=area.outline, holes=area.holes, source="tagged"))
    return tuple(found)
