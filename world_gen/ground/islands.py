"""What no car drives on amid the roads: a roundabout's middle, and islands between lanes."""

from __future__ import annotations

from collections import defaultdict

import numpy as np
import shapely
from shapely.geometry import Polygon

from foretwin.contracts.world import Area
from foretwin.world_gen.ground.kerbs import Paved
from foretwin.world_gen.lanes.clusters import Surroundings
from foretwin.world_gen.lanes.lane_curves import LaneSet
from foretwin.world_gen.osm.osm_map import OsmMap
from foretwin.world_gen.polygon_areas import GRID_M, area_of, areas_of
from foretwin.world_gen.roads.beside_roads import BesideRoads, in_frame

MIN_ISLAND_M2 = 2.5
MAX_ISLAND_M2 = 2500.0
RING_ISLAND = "island:ring"
"""Ids of a roundabout's middle begin with this; other islands begin with `island:traffic`."""


def island_areas(
    around: Surroundings, lanes: LaneSet, paved: Paved
) -> tuple[tuple[Area, ...], np.ndarray]:
    """Return all islands of whole junctions, and the middles of rings as polygons.

    An island is a hole in what a junction's places and the roads between and beside them cover.
    """
    roads_at: dict[str | None, list[int]] = defaultdict(list)
    for i, road in enumerate(lanes.roads):
        for place in {road.from_place, road.to_place}:
            roads_at[place].append(i)
    edge_of = {lane.road_id: lane.key.edge for lane in lanes.lanes.values()}
    places_of: dict[str, list[int]] = defaultdict(list)
    for k, cluster in enumerate(paved.place_of):
        if cluster.junction is not None:
            places_of[cluster.junction.summary.id].append(k)
    islands: list[Area] = []
    middles: list[Polygon] = []
    for junction in around.junctions:
        places = places_of[junction.summary.id]
        if len(junction.nodes) < 2 or not places:
            continue
        beside = sorted({r for k in places for r in roads_at[paved.place_of[k].key]})
        holes = _holes([*paved.places[places], *paved.roads[beside]])
        ring = any(edge_of.get(lanes.roads[i].id) in around.ring_edges for i in beside)
        middle = max(holes, key=lambda h: h.area) if ring and holes else None
        if middle is not None:
            middles.append(middle)
            islands.append(area_of(f"{RING_ISLAND}:{junction.summary.id}", middle))
        rest = sorted(
            (h for h in holes if h is not middle and h.area <= MAX_ISLAND_M2),
            key=lambda h: (-round(h.area, 3), h.bounds),
        )
        islands.extend(
            area_of(f"island:traffic:{junction.summary.id}:{i}", h) for i, h in enumerate(rest)
        )
    return tuple(islands), np.array(middles, dtype=object)


def _holes(pieces: list[Polygon]) -> list[Polygon]:
    """Return what a joined surface encloses, on the World's grid."""
    rings = [
        shapely.polygons(hole)
        for part in shapely.get_parts(shapely.union_all(pieces))
        if isinstance(part, Polygon)
        for hole in part.interiors
    ]
    holes = shapely.set_precision(np.array(rings, dtype=object), GRID_M)
    return [h for h in holes if isinstance(h, Polygon) and h.area >= MIN_ISLAND_M2]


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
