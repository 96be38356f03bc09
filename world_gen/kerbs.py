"""Kerbs: the edges of the paved ground, open where one piece of it leads to the next."""

from __future__ import annotations

import numpy as np
import shapely

from contracts.arrays import Array
from world_gen.lanes import LaneSet
from world_gen.paved import Paved

OVERLAP_M = 0.06
"""So far around a neighbouring piece its own border is no kerb."""
SHORTEST_M = 0.3


def kerb_lines(lanes: LaneSet, paved: Paved) -> tuple[Array, ...]:
    """Return the edges of roads and places, (N, 2) each, where no other piece of a level lies."""
    if not len(paved.roads) and not len(paved.places):
        return ()
    layers = [road.layer for road in lanes.roads]
    layers += [max(leg.edge.layer for leg in c.legs) for c in paved.place_of]
    pieces = np.concatenate([paved.roads, paved.places])
    sides = [line for road in lanes.roads for line in lanes.edges[road.id]]
    lines = _lines(sides)
    owner = np.repeat(np.arange(len(lanes.roads)), 2)
    borders = shapely.boundary(paved.places)
    lines = np.concatenate([lines, borders])
    owner = np.concatenate([owner, len(paved.roads) + np.arange(len(paved.places))])
    level = np.asarray(layers)
    row, piece = shapely.STRtree(pieces).query(lines, predicate="intersects")
    other = (owner[row] != piece) & (level[owner[row]] == level[piece])
    row, piece = row[other], piece[other]
    if len(row):
        order = np.argsort(row, kind="stable")
        used, indices = np.unique(row[order], return_inverse=True)
        beside = shapely.geometrycollections(pieces[piece[order]], indices=indices)
        beside = shapely.buffer(beside, OVERLAP_M, quad_segs=1)
        lines[used] = shapely.difference(lines[used], beside)
    parts = shapely.get_parts(shapely.line_merge(lines[~shapely.is_empty(lines)]))
    parts = parts[shapely.length(parts) > SHORTEST_M]
    return _points(parts)


def _lines(curves: list[Array]) -> np.ndarray:
    if not curves:
        return np.array([], dtype=object)
    counts = [len(c) for c in curves]
    found: np.ndarray = shapely.linestrings(
        np.concatenate(curves), indices=np.repeat(np.arange(len(curves)), counts)
    )
    return found


def _points(lines: np.ndarray) -> tuple[Array, ...]:
    points, row = shapely.get_coordinates(lines, return_index=True)
    ends = np.cumsum(np.bincount(row, minlength=len(lines)))[:-1]
    return tuple(np.split(np.round(points, 3), ends)) if len(lines) else ()
