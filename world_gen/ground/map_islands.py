"""Traffic islands that the map itself draws (`area:highway=traffic_island`)."""

from __future__ import annotations

import numpy as np
import shapely

from foretwin.contracts.world import Area
from foretwin.world_gen.ground.islands import MIN_ISLAND_M2
from foretwin.world_gen.ground.paved import GRID_M
from foretwin.world_gen.lanes.clusters import Surroundings
from foretwin.world_gen.osm.osm_map import OsmMap
from foretwin.world_gen.polygon_areas import areas_of
from foretwin.world_gen.roads.beside_roads import BesideRoads, in_frame


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
        name = f"island:traffic:w{way.id}"
        (islands,) = areas_of(
            [name], np.array([left], dtype=object), smallest_m2=MIN_ISLAND_M2, sources=["tagged"]
        )
        found.extend(islands)
    return tuple(found)
