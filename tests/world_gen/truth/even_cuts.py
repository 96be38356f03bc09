"""Lanes of an HD map cut where lanes beside them begin or end, so that neighbours match."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import shapely

from foretwin.contracts.arrays import Array
from foretwin.geometry.polyline import arc_lengths, cut
from tests.world_gen.truth.hd_map import HdLane, resampled

_LEAST_M = 3.0
"""No piece is shorter."""
_SHARED_M = 0.8
_SHARED_SHARE = 0.25
_ON_TOP_M = 1.6
_PASSES = 4


def evenly_cut(lanes: dict[str, HdLane]) -> dict[str, HdLane]:
    """Return the lanes outside junctions in pieces that begin and end side by side."""
    for _ in range(_PASSES):
        outside = [lane for lane in lanes.values() if not lane.inside]
        where = {lane.id: _cuts(lane, outside) for lane in outside}
        if not any(where.values()):
            break
        lanes = _cut_at(lanes, where)
    return lanes


def _cuts(lane: HdLane, others: list[HdLane]) -> list[float]:
    """Return at which shares of a lane's length the lanes beside it begin or end."""
    middle = lane.centerline
    line, length_m = shapely.LineString(middle), float(arc_lengths(middle)[-1])
    if length_m < 2.0 * _LEAST_M:
        return []
    found: list[float] = []
    for other in others:
        if other is lane or not _beside(lane, other):
            continue
        for point in (other.centerline[0], other.centerline[-1]):
            at_m = line.project(shapely.Point(point))
            if _LEAST_M < at_m < length_m - _LEAST_M:
                found.append(at_m)
    apart: list[float] = []
    for at_m in sorted(found):
        if not apart or at_m - apart[-1] > _LEAST_M:
            apart.append(at_m)
    return [at_m / length_m for at_m in apart]


def _beside(a: HdLane, b: HdLane) -> bool:
    along_a, along_b = a.centerline[-1] - a.centerline[0], b.centerline[-1] - b.centerline[0]
    same = float(along_a @ along_b) / (np.hypot(*along_a) * np.hypot(*along_b))
    if same > 0.8:
        return _shared(a.left, b.right) or _shared(a.right, b.left)
    return same < -0.8 and (
        _shared(a.left, b.left) or _shared(a.centerline, b.centerline, limit_m=_ON_TOP_M)
    )


def _shared(a: Array, b: Array, limit_m: float = _SHARED_M) -> bool:
    """Tell whether two edges run together for a quarter of the first, where both go on."""
    line = shapely.LineString(b)
    points = shapely.points(resampled(a, 24))
    at_m = shapely.line_locate_point(line, points)
    both = (at_m > 0.0) & (at_m < line.length)
    if both.mean() < _SHARED_SHARE and both.sum() < 3:
        return False
    return bool(np.median(shapely.distance(points[both], line)) < limit_m)


def _cut_at(lanes: dict[str, HdLane], where: dict[str, list[float]]) -> dict[str, HdLane]:
    first = {key: f"{key}/0" if where.get(key) else key for key in lanes}
    made: dict[str, HdLane] = {}
    for key, lane in lanes.items():
        after = tuple(first.get(name, name) for name in lane.successors)
        shares = [0.0, *where.get(key, []), 1.0]
        if len(shares) == 2:
            made[key] = replace(lane, successors=after)
            continue
        for i, (a, b) in enumerate(pairwise(shares)):
            name = f"{key}/{i}"
            last = i == len(shares) - 2
            made[name] = replace(
                lane,
                id=name,
                left=_piece(lane.left, a, b),
                right=_piece(lane.right, a, b),
                successors=after if last else (f"{key}/{i + 1}",),
            )
    return made


def _piece(line: Array, a: float, b: float) -> Array:
    length_m = float(arc_lengths(line)[-1])
    return cut(line, a * length_m, b * length_m)
