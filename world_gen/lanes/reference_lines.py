"""Reference lines of roads: ways cut where junctions begin and where the World ends, bends rounded.

A road's lanes and edges are offsets of its reference line.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.geometry.bends import Rounded, rounded_through, thinned, without_end_kinks
from foretwin.geometry.polyline import cut, left_of, length, points_at, units
from foretwin.geometry.polyline_batch import Polylines
from foretwin.geometry.polyline_batch import cut as cut_all
from foretwin.world_gen.extent import stretches_inside
from foretwin.world_gen.lanes.clusters import Surroundings

MIN_LANE_M = 0.05
INNER_RADIUS_M = 4.0
"""Where a road bends sharply, the radius of its inner edge."""
_STUB_M = 0.25
_NOWHERE = np.array([np.nan, np.nan])


class Stretch(NamedTuple):
    """A stretch of one edge along which lanes run side by side.

    `first` and `last` are whether it reaches the edge's own start and end, or the World's edge
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
    ways = thinned(Polylines.of([edge.xy_m for edge in edges]))
    total = ways.length_m
    long_enough = total - start_m - stop_m >= MIN_LANE_M
    notes = [
        f"way {edges[i].way_id}: {total[i]:.1f} m between junctions, too short for lanes"
        for i in np.nonzero(~long_enough)[0]
    ]
    kept = np.nonzero(long_enough)[0]
    if not len(kept):
        return [], notes
    pieces = thinned(cut_all(ways.rows(kept), start_m[kept], (total - stop_m)[kept]))
    pieces = without_end_kinks(pieces, start_m[kept] > 0.0, stop_m[kept] > 0.0)
    indices = [edges[i].index for i in kept.tolist()]
    half_m = np.array([around.sections[i].half_width_m for i in indices])
    goes_on = _points_beyond(around, indices, pieces)
    lines, befores, afters = _shifted(
        rounded_through(pieces, half_m + INNER_RADIUS_M, *goes_on), indices, around
    )
    outside = ~around.extent.holds(lines.xy_m)
    crosses = np.bincount(lines.line[outside], minlength=len(lines)) > 0
    found: list[Stretch] = []
    for index, line, crossing, before, after in zip(
        indices, lines.split(), crosses.tolist(), befores, afters, strict=True
    ):
        if not crossing:
            found.append(Stretch(index, line, True, True, before, after))
            continue
        full_m = length(line)
        for from_m, to_m in stretches_inside(line, around.extent):
            first, last = from_m == 0.0, abs(to_m - full_m) < 1e-9
            piece = line if first and last else cut(line, from_m, to_m)
            beyond = (before if first else _NOWHERE), (after if last else _NOWHERE)
            found.append(Stretch(index, piece, first, last, *beyond))
    return found, notes


def _shifted(rounded: Rounded, indices: list[int], around: Surroundings) -> Rounded:
    """Return the lines, those of roads in a transition led smoothly from one place to the other."""
    moving = [row for row, index in enumerate(indices) if index in around.shifts_m]
    if not moving:
        return rounded
    lines = rounded.lines.split()
    for row in moving:
        begin, end = around.shifts_m[indices[row]]
        line, aside = _evenly(lines[row], rounded.before[row], rounded.after[row])
        # Flat at both ends, so that lanes leave along those of the next road.
        share = np.linspace(0.0, 1.0, len(line) - 2)
        share = np.concatenate([[0.0], share * share * (3.0 - 2.0 * share), [1.0]])
        lines[row] = line + aside * (begin + (end - begin) * share)[:, None]
    return rounded._replace(lines=Polylines.of(lines))


def _evenly(line: Array, before: Array, after: Array) -> tuple[Array, Array]:
    """Return points about every metre of a line, and where a metre to its left lies from each.

    The first and last piece are short ones of the line's own, square to which other roads go on.
    """
    steps = np.hypot(*np.diff(line, axis=0).T)
    total, first, last = steps.sum(), min(_STUB_M, steps[0] / 3), min(_STUB_M, steps[-1] / 3)
    at_m = np.linspace(first, total - last, max(int(total), 2) + 1)
    points = points_at(line, np.concatenate([[0.0], at_m, [total]]))
    ahead = units(np.diff(points, axis=0))
    into = np.concatenate([[ahead[0] if np.isnan(before[0]) else before], ahead])
    out = np.concatenate([ahead, [ahead[-1] if np.isnan(after[0]) else after]])
    # Square to the first and last piece, as the road beside them is.
    into[1], out[-2] = ahead[0], ahead[-1]
    cos = (into * out).sum(axis=1)
    return points, left_of(into + out) / np.maximum(1.0 + cos, 0.5)[:, None]


def _points_beyond(
    around: Surroundings, indices: list[int], lines: Polylines
) -> tuple[Array, Array]:
    """Return (L, 2) next points before and after lines where a road merely goes on, else NaN."""
    row = {index: i for i, index in enumerate(indices)}
    beyond = np.full((2, len(indices), 2), np.nan)
    for cluster in around.clusters:
        if not cluster.plain or any(around.trims_m[leg.key] for leg in cluster.legs):
            continue
        for leg, other in (cluster.legs, cluster.legs[::-1]):
            mine, its = row.get(leg.edge.index), row.get(other.edge.index)
            if mine is not None and its is not None and mine != its:
                at = lines.first[its + 1] - 2 if other.reverse else lines.first[its] + 1
                beyond[int(leg.reverse), mine] = lines.xy_m[at]
    return beyond[0], beyond[1]
