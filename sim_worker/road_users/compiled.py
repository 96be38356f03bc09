"""Where road users are, and who is ahead of whom, compiled: see `foretwin.geometry.compiled`.

Cosines and sines come from numpy, where they are used: so nothing here rounds otherwise than there.
"""

from __future__ import annotations

import math

from foretwin.contracts.arrays import Array, Flags, Indices
from foretwin.geometry.compiled import IN, IN_ROWS, OUT, REAL, TABLE, WHOLE, given, kernel, types

FIELDS = 6
_ROWS = types.Array(WHOLE, 1, "A", readonly=True)
_ROUNDING_M = 1e-6


@kernel(
    WHOLE, _ROWS, TABLE, IN_ROWS, IN, types.UniTuple(REAL, 2), given(3), IN_ROWS, IN_ROWS, IN_ROWS,
    types.UniTuple(REAL, 2), WHOLE[::1], REAL[:, ::1],
)  # fmt: skip
def find_ahead(
    rows: Indices,
    mine: Array,
    ego_poses: Array,
    ego_mps: Array,
    ego_size_m: tuple[float, float],
    poses: Array,
    speed_mps: Array,
    length_m: Array,
    width_m: Array,
    limits_m: tuple[float, float],
    who: Indices,
    found: Array,
) -> int:
    """Fill pairs of K drivers and those ahead of them, near the parabolas they drive along; returns
    how many.

    `rows` (K,) are their futures, `mine` (8, K) x, y, yaw, its cosine and sine, half the bend, the
    width and half the length; the ego (S, 3) comes before others (S, R, 3). `limits_m` are how far
    they look, and how far beside. Of a pair `who` (N,) is the driver, and `found` (6, N) how far
    the other is ahead and to the left, how it is turned, its length, width and speed.
    """
    count = 0
    sight_m, beside_m = limits_m
    for k in range(len(rows)):
        row = rows[k]
        cos, sin = mine[3, k], mine[4, k]
        for other in range(-1, poses.shape[1]):
            if other < 0:
                x, y, yaw = ego_poses[row, 0], ego_poses[row, 1], ego_poses[row, 2]
                length, width = ego_size_m
            else:
                x, y, yaw = poses[row, other, 0], poses[row, other, 1], poses[row, other, 2]
                length, width = length_m[row, other], width_m[row, other]
            dx, dy = x - mine[0, k], y - mine[1, k]
            ahead = cos * dx + sin * dy
            # False for who is absent, and for oneself.
            if not 0.0 < ahead < sight_m:
                continue
            left = cos * dy - sin * dx - mine[5, k] * (ahead * ahead)
            widest = 0.5 * (mine[6, k] + length + width) + beside_m + _ROUNDING_M
            if abs(left) > widest or dx * dx + dy * dy >= sight_m * sight_m:
                continue
            who[count] = k
            found[0, count], found[1, count], found[2, count] = ahead, left, yaw - mine[2, k]
            found[3, count], found[4, count] = length, width
            found[5, count] = ego_mps[row] if other < 0 else speed_mps[row, other]
            count += 1
    return count


@kernel(types.void, _ROWS, IN_ROWS, IN, IN, TABLE, REAL, OUT, OUT)
def take_nearest(
    who: Indices,
    found: Array,
    cos: Array,
    sin: Array,
    mine: Array,
    beside_m: float,
    gap_m: Array,
    lead_mps: Array,
) -> None:
    """Lower gaps (K,) to those to whom of the pairs of `find_ahead` is in the way, and fill their
    speeds along it (K,); `cos` and `sin` (N,) are of how the others are turned."""
    for pair in range(len(who)):
        k = who[pair]
        along, across = abs(cos[pair]), abs(sin[pair])
        long, wide = found[3, pair], found[4, pair]
        beside = 0.5 * (mine[6, k] + long * across + wide * along) + beside_m
        gap = found[0, pair] - mine[7, k] - 0.5 * (long * along + wide * across)
        if abs(found[1, pair]) < beside and gap <= gap_m[k]:
            gap_m[k], lead_mps[k] = gap, max(found[5, pair] * cos[pair], 0.0)


@kernel(types.void, *[IN_ROWS] * 7, IN, IN, types.UniTuple(REAL, 4), OUT, OUT)
def nearest_in_way(
    arc_m: Array,
    offset_m: Array,
    cos: Array,
    sin: Array,
    speed_mps: Array,
    length_m: Array,
    width_m: Array,
    own_arc_m: Array,
    own_offset_m: Array,
    own_m: tuple[float, float, float, float],
    gap_m: Array,
    lead_mps: Array,
) -> None:
    """Fill the gaps (S,) to whoever of others (S, R) is next in the way, infinite without one, and
    its speeds along the way (S,), 0 without one.

    `own_m` are how far the own front is before its place, its length and width, and what counts as
    in the way beside it.
    """
    front, length, width, margin = own_m
    for car in range(arc_m.shape[0]):
        nearest, speed = math.inf, 0.0
        for other in range(arc_m.shape[1]):
            aside = abs(offset_m[car, other] - own_offset_m[car])
            along, across = abs(cos[car, other]), abs(sin[car, other])
            long, wide = length_m[car, other], width_m[car, other]
            gap = arc_m[car, other] - own_arc_m[car] - front
            gap -= 0.5 * (long * along + wide * across)
            beside = 0.5 * (long * across + wide * along + width) + margin
            if aside < beside and -length < gap < nearest:
                nearest, speed = gap, speed_mps[car, other] * cos[car, other]
        gap_m[car], lead_mps[car] = nearest, speed


@kernel(types.void, _ROWS, _ROWS, _ROWS, given(3), IN, IN, given(3), IN_ROWS, types.boolean[:, :])
def hide_behind(
    futures: Indices,
    hidden: Indices,
    hiders: Indices,
    poses: Array,
    cos: Array,
    sin: Array,
    size_m: Array,
    eyes_xy_m: Array,
    unseen: Flags,
) -> None:
    """Mark in `unseen` (S, R) those of H hidden ones to whom the line from the eyes (S, 2) meets
    what hides them; `cos` and `sin` (H,) are of how that is turned, sizes (S, R, 2)."""
    for h in range(len(futures)):
        s, r, by = futures[h], hidden[h], hiders[h]
        x, y = poses[s, by, 0], poses[s, by, 1]
        dx, dy = eyes_xy_m[s, 0] - x, eyes_xy_m[s, 1] - y
        to_x, to_y = poses[s, r, 0] - x, poses[s, r, 1] - y
        low, high = -math.inf, math.inf
        for axis in range(2):
            if axis == 0:
                start, end = cos[h] * dx + sin[h] * dy, cos[h] * to_x + sin[h] * to_y
            else:
                start, end = cos[h] * dy - sin[h] * dx, cos[h] * to_y - sin[h] * to_x
            half, way = 0.5 * size_m[s, by, axis], end - start
            near, far = (-half - start) / way, (half - start) / way
            if math.isnan(near) or math.isnan(far):
                # A line that runs along a side, 0 / 0, is not stopped, nor is one of who is away.
                low, high = math.inf, -math.inf
            else:
                low, high = max(low, min(near, far)), min(high, max(near, far))
        if low <= high and high >= 0.0 and low <= 1.0:
            unseen[s, r] = True


@kernel(types.void, _ROWS, IN, TABLE, TABLE, REAL[:, ::1])
def interpolate(node: Indices, share: Array, poses: Array, steps: Array, found: Array) -> None:
    """Fill poses (N, 3) at places (N,) between nodes (M, 3), by the steps (M, 3) to the next."""
    for n in range(len(node)):
        at, part = node[n], share[n]
        for k in range(3):
            found[n, k] = steps[at, k] * part + poses[at, k]
