"""Kerbs: the edges of the paved ground, open where one piece of it leads to the next."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import shapely

from foretwin.contracts.arrays import Array
from foretwin.world_gen.lanes.cluster import Cluster
from foretwin.world_gen.lanes.lane_curves import LaneSet
from foretwin.world_gen.polygon_areas import cut_out, lines_of

OVERLAP_M = 0.06
"""So near to a neighbouring piece the border of a place is no kerb."""
SHORTEST_M = 0.3


class Paved(NamedTuple):
    """Pieces of paved ground as shapely polygons: of roads, and of places where they meet.

    `roads[i]` belongs to the World's i-th road, `places[k]` to the cluster `place_of[k]`.
    """

    roads: np.ndarray
    places: np.ndarray
    place_of: tuple[Cluster, ...]


def kerb_lines(lanes: LaneSet, paved: Paved) -> tuple[Array, ...]:
    """Return the edges of roads and places, (N, 2) each, where no other piece of a level lies."""
    pieces = np.concatenate([paved.roads, paved.places])
    if not len(pieces):
        return ()
    layers = [road.layer for road in lanes.roads]
    layers += [max(leg.edge.layer for leg in c.legs) for c in paved.place_of]
    layer = np.array(layers)
    tree = shapely.STRtree(pieces)
    lines = [*_road_edges(lanes, paved, tree, layer), *_place_borders(paved, tree, layer)]
    joined = shapely.get_parts(shapely.line_merge(np.array(lines, dtype=object)))
    joined = joined[shapely.length(joined) > SHORTEST_M]
    if not len(joined):
        return ()
    points, row = shapely.get_coordinates(joined, return_index=True)
    ends = np.cumsum(np.bincount(row, minlength=len(joined)))[:-1]
    return tuple(np.split(np.round(points, 3), ends))


def _road_edges(
    lanes: LaneSet, paved: Paved, tree: shapely.STRtree, layer: Array
) -> list[shapely.Geometry]:
    """Return both edges of every road without what lies in other pieces."""
    if not lanes.roads:
        return []
    lines = lines_of([line for road in lanes.roads for line in lanes.edges[road.id]])
    road = np.repeat(np.arange(len(lanes.roads)), 2)
    row, piece = tree.query(lines)
    place_row = {c.key: len(paved.roads) + k for k, c in enumerate(paved.place_of)}
    ends = [(r.from_place or "", r.to_place or "") for r in lanes.roads]
    own = np.array([[place_row.get(key, -1) for key in pair] for pair in ends])[road[row]]
    # A road's edge ends where its own places begin: nothing of it lies inside.
    wanted = (road[row] != piece) & (own != piece[:, None]).all(axis=1)
    wanted &= layer[road[row]] == layer[piece]
    row, piece = row[wanted], piece[wanted]
    # Looking closely only now is cheaper: most of what is near is a road's own.
    meet = shapely.intersects(lines[row], tree.geometries[piece])
    cut_out(lines, tree.geometries, row[meet], piece[meet])
    return list(lines[~shapely.is_empty(lines)])


def _place_borders(paved: Paved, tree: shapely.STRtree, layer: Array) -> list[shapely.Geometry]:
    """Return the borders of places without the mouths of roads, segment by segment."""
    if not len(paved.places):
        return []
    rings, owner = shapely.get_rings(paved.places, return_index=True)
    points, ring = shapely.get_coordinates(rings, return_index=True)
    inside = ring[1:] == ring[:-1]
    a, b = points[:-1][inside], points[1:][inside]
    mine = len(paved.roads) + owner[ring[1:][inside]]
    middle = (a + b) / 2
    row, piece = tree.query(shapely.box(*(middle - OVERLAP_M).T, *(middle + OVERLAP_M).T))
    other = (mine[row] != piece) & (layer[mine[row]] == layer[piece])
    row, piece = row[other], piece[other]
    near = shapely.dwithin(shapely.points(middle[row]), tree.geometries[piece], OVERLAP_M)
    open_ = np.ones(len(a), dtype=bool)
    open_[row[near]] = False
    segments = shapely.linestrings(np.stack([a, b], axis=1)[open_])
    used, indices = np.unique(mine[open_], return_inverse=True)
    return list(shapely.multilinestrings(segments, indices=indices)) if len(used) else []
