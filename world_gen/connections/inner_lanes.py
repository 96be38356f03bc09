"""Paths through wide junctions: along the lanes of the roads inside, with turns between them."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.geometry.polyline import length, offset, points_at, without_repeats
from foretwin.geometry.steering import LEAST_RADIUS_M
from foretwin.geometry.turn_curves import turn_curves
from foretwin.world_gen.connections.lane_connections import ConnectionDraft
from foretwin.world_gen.lanes.clusters import Surroundings
from foretwin.world_gen.lanes.lane_plans import LanePlan

_LONG_EDGE_M = 18.0
"""Roads inside a junction that are shorter are crossed in one sweep."""
_TURN_ROOM_M = 10.0
_MOST_LEFT_RAD = math.radians(30.0)
"""A piece that leaves the angle between two lanes farther has no room there: no car drives it."""


class _Pose(NamedTuple):
    at: Array
    heading: Array


def paths_along_inner_lanes(
    connections: list[ConnectionDraft], around: Surroundings
) -> dict[int, Array]:
    """Return (N, 2) paths by the connection's place in the list, where the lanes inside allow one.

    Each leads through its lane of every long road inside, and turns where the roads meet; left
    out are those with a turn tighter than a car can drive.
    """
    starts: dict[int, set[int]] = {}
    for c in connections:
        starts.setdefault(id(c.movement), set()).add(c.start.plan.number)
    known: dict[tuple[int, bool, float], list[_Pose]] = {}
    poses: list[_Pose] = []
    ends: list[_Pose] = []
    owner: list[int] = []
    for i, c in enumerate(connections):
        if all(part.edge.length_m < _LONG_EDGE_M for part in c.movement.inside):
            continue
        first, last = c.start.centerline, c.end.centerline
        chain = [
            _Pose(first[-1], _unit(first[-1] - first[-2])),
            *_poses_inside(c, sorted(starts[id(c.movement)]), around, known),
            _Pose(last[0], _unit(last[1] - last[0])),
        ]
        poses += chain[:-1]
        ends += chain[1:]
        owner += [i] * (len(chain) - 1)
    if not owner:
        return {}
    turns = turn_curves(
        np.array([p.at for p in poses]),
        np.array([p.heading for p in poses]),
        np.array([p.at for p in ends]),
        np.array([p.heading for p in ends]),
    )
    pieces: dict[int, list[Array]] = {}
    refused: set[int] = set()
    no_room = (turns.radius_m < LEAST_RADIUS_M) | (turns.left_rad > _MOST_LEFT_RAD)
    for i, piece, refuse in zip(owner, turns.lines.split(), no_room.tolist(), strict=True):
        pieces.setdefault(i, []).append(piece)
        if refuse:
            refused.add(i)
    kept = {i: pieces[i] for i in pieces.keys() - refused}
    return {i: np.concatenate([mine[0], *(p[1:] for p in mine[1:])]) for i, mine in kept.items()}


def _poses_inside(
    c: ConnectionDraft,
    starts: list[int],
    around: Surroundings,
    known: dict[tuple[int, bool, float], list[_Pose]],
) -> list[_Pose]:
    """Return where a path enters and leaves its lanes inside; `starts` are its movement's lanes."""
    found: list[_Pose] = []
    for part in c.movement.inside:
        plans = around.lanes_along(part).driven
        if part.edge.length_m < _LONG_EDGE_M or not plans:
            continue
        left_m = _driver_left_m(plans, _lane_inside(c, starts, len(plans), around))
        key = (part.edge.index, part.reverse, left_m)
        if key not in known:
            known[key] = _poses_along(part.xy_m, left_m)
        found += known[key]
    return found


def _lane_inside(c: ConnectionDraft, starts: list[int], room: int, around: Surroundings) -> float:
    """Return which of `room` lanes inside a connection takes, from the left; each of its movement
    another, those that the map has no lane for beside the rest, away from what they turn across.
    Who goes straight on keeps the place from the middle of the road, where there is one.
    """
    number = c.start.plan.number
    rank, spare = starts.index(number), room - len(starts)
    keeps_right = around.driving_side == "right"
    if c.turn == "right" or (c.turn == "u_turn" and not keeps_right):
        return rank + spare
    if c.turn != "straight":
        return rank
    if spare < 0:
        return rank + spare / 2
    if keeps_right:
        return min(number, rank + spare)
    abreast = len(around.lanes_along(c.movement.toward).driven)
    return max(room - abreast + number, rank)


def _driver_left_m(plans: tuple[LanePlan, ...], number: float) -> float:
    """Return how far left of the way its driver finds a lane, be it one beside those there are."""
    plan = plans[int(min(max(number, 0), len(plans) - 1))]
    at_m = -plan.left_m if plan.reverse else plan.left_m
    return at_m - (number - plans.index(plan)) * plan.width_m.value


def _poses_along(way: Array, left_m: float) -> list[_Pose]:
    """Return where turns off a lane end and begin: near both ends of it, or in its middle."""
    line = offset(without_repeats(way), left_m)
    total_m = length(line)
    room_m = min(_TURN_ROOM_M, total_m / 2)
    at_m = sorted({room_m, total_m - room_m})
    near = points_at(line, np.array([[at - 0.5, at, at + 0.5] for at in at_m]).ravel())
    return [_Pose(near[i + 1], _unit(near[i + 2] - near[i])) for i in range(0, len(near), 3)]


def _unit(vector: Array) -> Array:
    return np.asarray(vector / max(math.hypot(*vector), 1e-9))
