"""Ways of road users: their paths, the turns they take, and where lines head."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import wrap_angle
from foretwin.contracts.scenario import TrafficTurn
from foretwin.contracts.world import DrivingSide
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.geometry.polyline import arc_lengths, points_at, unit

APPROACH_M, DEPARTURE_M = 150.0, 120.0
"""How far ways are led back and on along the lanes."""
_HEADING_OVER_M = 8.0
_STRAIGHT_RAD, _BACK_RAD = math.radians(45.0), math.radians(150.0)
_CLEARER_BY_RAD = math.radians(20.0)


class Way(NamedTuple):
    """A path for a road user: `xy_m` (N, 2), arc length 0 at its first point.

    `speed_limit_mps` (N,). The junction lies between `entry_m` and `exit_m`; lanes of the World
    carry it from `first_m` to `last_m`, beyond which it goes on straight.
    """

    name: str
    xy_m: Array
    speed_limit_mps: Array
    path: FrenetPath
    entry_m: float
    exit_m: float
    first_m: float
    last_m: float


def lengthened(name: str, xy: Array, limit: Array, entry_m: float, exit_m: float) -> Way:
    """Return the way along a polyline, led straight on at either end as far as ways go."""
    arc = arc_lengths(xy)
    before = max(0.0, APPROACH_M - entry_m)
    after = max(0.0, DEPARTURE_M - (float(arc[-1]) - exit_m))
    # Ends clipped at the World's edge can be short: a few metres tell where the road heads.
    first = unit(xy[0] - points_at(xy, _HEADING_OVER_M / 2))
    last = unit(xy[-1] - points_at(xy, float(arc[-1]) - _HEADING_OVER_M / 2))
    parts, limits = [xy], [limit]
    if before > 0.5:
        parts.insert(0, (xy[0] + before * first)[None])
        limits.insert(0, limit[:1])
    else:
        before = 0.0
    if after > 0.5:
        parts.append((xy[-1] + after * last)[None])
        limits.append(limit[-1:])
    line = np.concatenate(parts)
    return Way(
        name=name,
        xy_m=line,
        speed_limit_mps=np.concatenate(limits),
        path=FrenetPath(line, np.concatenate(limits)),
        entry_m=entry_m + before,
        exit_m=exit_m + before,
        first_m=before,
        last_m=before + float(arc[-1]),
    )


def near_sign(side: DrivingSide) -> float:
    """Return +1 where the near side is the right one, else -1."""
    return 1.0 if side == "right" else -1.0


def traffic_turn(turn: str, side: DrivingSide) -> TrafficTurn | None:
    """Name a turn by the traffic: left is across where one drives on the right."""
    if turn == "straight":
        return "straight"
    if turn == "u_turn":
        return None
    return "across" if (turn == "left") == (side == "right") else "near"


def unlike_its_turn(turn: TrafficTurn | None, change_rad: float) -> int:
    """Return by how many steps a change of heading differs from what a turn makes one think of.

    A fork may be called a turn; where a right angle is at hand as well, it is the clearer one.
    """
    meant = 0.0 if turn == "straight" else math.pi / 2.0
    return round(abs(abs(float(wrap_angle(change_rad))) - meant) / _CLEARER_BY_RAD)


def turn_by_heading(change_rad: float, side: DrivingSide) -> TrafficTurn | None:
    """Name a way round a ring by how much it turns; None where it leads back."""
    if abs(change_rad) >= _BACK_RAD:
        return None
    if abs(change_rad) < _STRAIGHT_RAD:
        return "straight"
    return traffic_turn("left" if change_rad > 0.0 else "right", side)


def heading_of(line: Array, *, backwards: bool) -> float:
    """Return where a line heads at its first point, looked at over a few metres."""
    step = points_at(line, _HEADING_OVER_M) - line[0]
    if backwards:
        step = -step
    return math.atan2(float(step[1]), float(step[0]))


def bend_between(before: Array, after: Array) -> float:
    """Return by how much one turns from the end of one line into the other."""
    if len(before) < 2 or len(after) < 2:
        return math.pi
    turn = heading_of(after, backwards=False) - heading_of(before[::-1], backwards=True)
    return abs(float(wrap_angle(turn)))
