"""How far off a World's paved areas may be drawn: by where their widths and places came from."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import shapely

from foretwin.contracts.arrays import Array
from foretwin.contracts.world import DRAWN_ATTRIBUTION, Area, Lane, Road, World
from foretwin.sim_worker.metrics.ground import paved_areas, polygon_of
from foretwin.world_gen.driven.matching import MAP_ERROR_M

TAGGED_EDGE_M = 0.5
"""How far ground that can be driven goes on beyond an edge whose width is tagged, at most, in 95 of
100 places. Chosen: widths are mostly given to half a metre or a metre."""
COUNTED_EDGE_M, UNCOUNTED_EDGE_M = 4.24, 6.64
"""The same where only lanes are counted, and where not even these are: strips for parking, wide
lanes, round corners. Measured on HD maps: `python -m tests.world_gen.truth.road_edges`."""
DRIVEN_PLACE_STD_M = 0.56
"""Of a lane's place where the car's own passes say it: half lie within 0.38 m (docs/tracks.md)."""
_TOUCHING_M = 1.0


class EdgeDoubt(NamedTuple):
    """Of each paved area (A,): how far its ground may go on, and how far all of it may lie beside.

    `edge_m` holds in 95 of 100 places, `place_std_m` is one standard deviation.
    """

    edge_m: Array
    place_std_m: Array


def is_exact(world: World) -> bool:
    """Whether a World is the very place: drawn for foretwin, so that nothing else is there."""
    return world.attribution == DRAWN_ATTRIBUTION


def edge_doubt(world: World) -> EdgeDoubt:
    """Return what is not known of the areas of a World, in the order of `paved_areas`."""
    areas = paved_areas(world)
    if is_exact(world):
        return EdgeDoubt(np.zeros(len(areas)), np.zeros(len(areas)))
    lanes = {lane.id: lane for lane in world.lanes}
    of_road = [[lanes[key] for key in road.lane_ids if key in lanes] for road in world.roads]
    known = zip(world.roads, of_road, strict=True)
    edges_m = np.array([_edge_m(road, mine) for road, mine in known])
    places_m = np.array([_place_std_m(mine) for mine in of_road])
    edge_m = np.full(len(areas), UNCOUNTED_EDGE_M)
    place_std_m = np.full(len(areas), MAP_ERROR_M)
    for row, mine in enumerate(_roads_of(areas, world.roads)):
        if len(mine):
            edge_m[row], place_std_m[row] = edges_m[mine].max(), places_m[mine].max()
    return EdgeDoubt(edge_m, place_std_m)


def _edge_m(road: Road, lanes: Sequence[Lane]) -> float:
    # An inferred width is a lane's share of the road's own, which is tagged.
    if lanes and all(lane.width_m.source in ("tagged", "inferred") for lane in lanes):
        return TAGGED_EDGE_M
    return COUNTED_EDGE_M if road.lane_count_source == "tagged" else UNCOUNTED_EDGE_M


def _place_std_m(lanes: Sequence[Lane]) -> float:
    driven = bool(lanes) and all(lane.position_source == "driven" for lane in lanes)
    return DRIVEN_PLACE_STD_M if driven else MAP_ERROR_M


def _roads_of(areas: Sequence[Area], roads: Sequence[Road]) -> list[Array]:
    """Return of each area the rows of the roads inside it, or else of those that touch it."""
    lines = np.array([shapely.LineString(road.reference_line) for road in roads], dtype=object)
    tree = shapely.STRtree(lines)
    found = []
    for polygon in map(polygon_of, areas):
        near = tree.query(polygon, predicate="dwithin", distance=_TOUCHING_M)
        inside = shapely.length(shapely.intersection(lines[near], polygon)) > _TOUCHING_M
        found.append(near[inside] if inside.any() else near)
    return found
