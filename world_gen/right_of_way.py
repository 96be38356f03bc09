"""Which connections cross each other, and a first answer to who yields."""

from __future__ import annotations

import math

import numpy as np
import shapely

from contracts.world import DrivingSide, LineControl
from world_gen.connections import ConnectionDraft

SWEPT_HALF_WIDTH_M = 1.0
"""Half the width of a car's path; swept areas of two connections overlap where they conflict."""
_RANK: dict[LineControl, int] = {"none": 2, "signal": 2, "give_way": 1, "stop": 0}


def add_right_of_way(connections: list[ConnectionDraft], driving_side: DrivingSide) -> None:
    """Fill conflicts and yields of connections that share a cluster.

    In each conflicting pair exactly one yields: by sign first; then who turns across oncoming
    traffic yields, then who comes from the other's left; the last resort is their order.
    """
    if not connections:
        return
    lines = shapely.linestrings(
        np.concatenate([c.centerline for c in connections]),
        indices=np.repeat(np.arange(len(connections)), [len(c.centerline) for c in connections]),
    )
    swept = shapely.buffer(lines, SWEPT_HALF_WIDTH_M, cap_style="flat", quad_segs=2)
    first, second = shapely.STRtree(swept).query(swept, predicate="intersects")
    later = first < second
    conflicts: dict[int, set[int]] = {}
    yields: dict[int, set[int]] = {}
    for i, j in zip(first[later].tolist(), second[later].tolist(), strict=True):
        a, b = connections[i], connections[j]
        if a.cluster is not b.cluster or a.start.id == b.start.id:
            continue
        if a.end.id != b.end.id and shapely.intersection(swept[i], swept[j]).area < 0.3:
            continue
        conflicts.setdefault(i, set()).add(j)
        conflicts.setdefault(j, set()).add(i)
        loser, winner = (i, j) if _yields(a, b, driving_side) else (j, i)
        yields.setdefault(loser, set()).add(winner)
    for i, connection in enumerate(connections):
        connection.conflicts_with = tuple(sorted(connections[j].id for j in conflicts.get(i, ())))
        connection.yields_to = tuple(sorted(connections[j].id for j in yields.get(i, ())))


def _yields(a: ConnectionDraft, b: ConnectionDraft, driving_side: DrivingSide) -> bool:
    """Return whether `a` yields to `b`."""
    if _RANK[a.control] != _RANK[b.control]:
        return _RANK[a.control] < _RANK[b.control]
    ring_a, ring_b = a.start.role == "ring", b.start.role == "ring"
    if ring_a != ring_b:
        return ring_b
    angle = _from_right(a, b)
    if abs(angle) > math.radians(135.0):  # oncoming: who crosses the other's lane waits
        near, far = ("right", "left") if driving_side == "right" else ("left", "right")
        weight = {"straight": 0, near: 1, far: 2, "u_turn": 3}
        if weight[a.turn] != weight[b.turn]:
            return weight[a.turn] > weight[b.turn]
    elif abs(angle) > math.radians(30.0):
        return angle > 0.0
    return a.id > b.id


def _from_right(a: ConnectionDraft, b: ConnectionDraft) -> float:
    """Return the angle from a's to b's heading at the start; positive: b comes from a's right."""
    da, db = a.centerline[1] - a.centerline[0], b.centerline[1] - b.centerline[0]
    return math.atan2(da[0] * db[1] - da[1] * db[0], float(da @ db))
