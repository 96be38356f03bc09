"""Kerbs: the edges of the paved ground, open where one piece of it leads to the next."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import shapely

from foretwin.contracts.arrays import Array, Indices
from foretwin.geometry.polyline import Flags
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
    first = len(paved.roads)
    place_row = {c.key: first + k for k, c in enumerate(paved.place_of) if not c.ring}
    ends = [(r.from_place or "", r.to_place or "") for r in lanes.roads]
    own = np.array([[place_row.get(key, -1) for key in pair] for pair in ends])[road[row]]
    # A road's edge ends where its own places begin: nothing of it lies inside. In a ring what is
    # swept into the next road reaches beyond the mouth of the ring's own.
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
    ends, ring = _segments(rings)
    mine = len(paved.roads) + owner[ring]
    places = ends[:, 0], ends.mean(axis=1), ends[:, 1]
    covered = sum(_covered(at, mine, tree, layer).astype(np.intp) for at in places)
    free, partly = covered == 0, (covered > 0) & (covered < len(places))
    split, row = _segments(
        shapely.segmentize(shapely.linestrings(ends[partly]), max_segment_length=SHORTEST_M)
    )
    of_split = mine[partly][row]
    kept = ~_covered(split.mean(axis=1), of_split, tree, layer)
    kerbs = np.concatenate([ends[free], split[kept]])
    used, of_kerb = np.unique(np.concatenate([mine[free], of_split[kept]]), return_inverse=True)
    if not len(used):
        return []
    order = np.argsort(of_kerb, kind="stable")
    lines = shapely.linestrings(kerbs[order])
    return list(shapely.multilinestrings(lines, indices=of_kerb[order]))


def _segments(lines: np.ndarray) -> tuple[Array, Indices]:
    """Return the ends (K, 2, 2) of all segments of lines, and which line each is of, (K,)."""
    points, row = shapely.get_coordinates(lines, return_index=True)
    same = row[1:] == row[:-1]
    return np.stack([points[:-1], points[1:]], axis=1)[same], row[1:][same]


def _covered(points: Array, mine: Indices, tree: shapely.STRtree, layer: Array) -> Flags:
    """Return whether another piece than its own, of its level, lies at each point (N, 2)."""
    row, piece = tree.query(shapely.box(*(points - OVERLAP_M).T, *(points + OVERLAP_M).T))
    other = (mine[row] != piece) & (layer[mine[row]] == layer[piece])
    row, piece = row[other], piece[other]
    near = shapely.dwithin(shapely.points(points[row]), tree.geometries[piece], OVERLAP_M)
    found = np.zeros(len(points), dtype=bool)
    found[row[near]] = True
    return found
