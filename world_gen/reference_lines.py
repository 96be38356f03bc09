"""Reference lines of roads: ways cut where junctions begin and where the World ends, bends rounded.

A road's lanes and edges are offsets of its reference line.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from contracts.arrays import Array
from world_gen.clusters import Surroundings
from world_gen.extent import stretches_inside
from world_gen.polyline import cut, unit, without_repeats
from world_gen.polyline_batch import Polylines
from world_gen.polyline_batch import cut as cut_all
from world_gen.polyline_batch import rounded as rounded_all
from world_gen.polyline_batch import without_repeats as without_repeats_all

MIN_LANE_M = 0.05
_NOWHERE = np.array([np.nan, np.nan])


class Stretch(NamedTuple):
    """A stretch of one edge along which lanes run side by side.

    `first` and `last` tell whether it reaches the edge's own start and end, or the World's edge
    cut it. `before` and `after` (2,) are the directions in which a road that merely goes on
    continues beyond them, along the nodes; NaN where it does not.
    """

    edge: int
    line: Array
    first: bool
    last: bool
    before: Array
    after: Array


def reference_lines(around: Surroundings) -> tuple[list[Stretch], list[str]]:
    """Return the stretches of all edges outside junctions, by edge index, and what was left out."""
    inner = frozenset().union(*(c.inner for c in around.clusters))
    edges = [edge for index, edge in sorted(around.edges.items()) if index not in inner]
    if not edges:
        return [], []
    start_m = np.array([around.trims_m.get((e.index, False), 0.0) for e in edges])
    stop_m = np.array([around.trims_m.get((e.index, True), 0.0) for e in edges])
    ways = without_repeats_all(Polylines.of([edge.xy_m for edge in edges]))
    total = ways.length_m
    long_enough = total - start_m - stop_m >= MIN_LANE_M
    notes = [
        f"way {edges[i].way_id}: {total[i]:.1f} m between junctions, too short for lanes"
        for i in np.nonzero(~long_enough)[0]
    ]
    kept = np.nonzero(long_enough)[0]
    lines = rounded_all(cut_all(ways.rows(kept), start_m[kept], (total - stop_m)[kept]))
    outside = ~around.extent.holds(lines.xy_m)
    crosses = np.bincount(lines.line[outside], minlength=len(lines)) > 0
    beyond = _directions_beyond(around)
    found: list[Stretch] = []
    for i, line, crossing in zip(kept.tolist(), lines.split(), crosses.tolist(), strict=True):
        index = edges[i].index
        before = _NOWHERE if start_m[i] else beyond.get((index, False), _NOWHERE)
        after = _NOWHERE if stop_m[i] else beyond.get((index, True), _NOWHERE)
        if not crossing:
            found.append(Stretch(index, line, True, True, before, after))
            continue
        full_m = float(np.hypot(*np.diff(line, axis=0).T).sum())
        for from_m, to_m in stretches_inside(line, around.extent):
            first, last = from_m == 0.0, abs(to_m - full_m) < 1e-9
            piece = line if first and last else cut(line, from_m, to_m)
            found.append(
                Stretch(
                    index, piece, first, last,
                    before if first else _NOWHERE, after if last else _NOWHERE,
                )
            )  # fmt: skip
    return found, notes


def _directions_beyond(around: Surroundings) -> dict[tuple[int, bool], Array]:
    """Return, where a road merely goes on, its direction beyond each end (along the nodes)."""
    beyond: dict[tuple[int, bool], Array] = {}
    for cluster in around.clusters:
        if not cluster.plain or any(
            around.trims_m[leg.edge.index, leg.reverse] for leg in cluster.legs
        ):
            continue
        for leg, other in (cluster.legs, cluster.legs[::-1]):
            xy = without_repeats(other.xy_m)
            away = unit(xy[1] - xy[0])
            # Along the nodes: into this edge's start from the other, or on from its end.
            beyond[leg.edge.index, leg.reverse] = away if leg.reverse else -away
    return beyond
