"""Who of going traffic has to brake now, so that nobody drives into anybody.

Drivers of the traffic model notice late and follow close, as people do, and here they go on for
much longer than a future lasts. Whoever brakes fully comes to rest somewhere: as long as all of
these ways to rest are apart, everybody can still be stopped. Who would end that with its next step
brakes instead (as Shalev-Shwartz, Shammah and Shashua 2017, On a Formal Model of Safe and Scalable
Self-driving Cars, keep a proper response open to everybody).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array, Flags, Indices
from foretwin.geometry.rectangles import Rectangles, overlapping
from foretwin.sim_worker.driver_model import MAX_DECEL_MPS2
from foretwin.sim_worker.road_users.crowd import EgoBoxes
from foretwin.sim_worker.road_users.traffic import Traffic
from foretwin.sim_worker.virtual_traffic.source import STEP_S

_EVERY_S = 0.1
"""Between the instants of a way to rest that are looked at."""
_ROOM_M = np.array([0.5, 0.2])
"""By which boxes count as longer and wider: what lies between those instants. Chosen."""
_SURE = 0.85
"""The share of their grip that ways to rest are reckoned with: bends ahead may leave less."""


class _Ways(NamedTuple):
    """Ways to rest of N boxes at T instants from now on: x, y, yaw (2, N, T, 3), first of who goes
    on for one more step, then of who brakes at once; and their sizes (N, 2)."""

    poses: Array
    size_m: Array

    def meet(self, one: Indices, other: Indices, brake: Flags, room_m: Array) -> Flags:
        """Return (P, T) when pairs of boxes touch, of whom those brake (N,) at once; boxes are
        larger by `room_m` (P, 2)."""
        a, b = (
            Rectangles(
                self.poses[brake[k].astype(np.intp), k][..., :2],
                self.poses[brake[k].astype(np.intp), k][..., 2],
                *(self.size_m[k] + room_m).T[..., None],
            )
            for k in (one, other)
        )
        return np.asarray(overlapping(a, b))


def who_must_brake(traffic: Traffic, car: EgoBoxes, grip_mps2: Array) -> Flags:
    """Return (R,) who has to brake with all its grip (R,) in the coming step, given what everybody
    has decided. The car, which does as it does, is one more to keep apart from."""
    ways = _ways(traffic, car, _SURE * grip_mps2)
    count = len(ways.size_m) - 1
    must = np.zeros(count + 1, dtype=bool)
    one, other, room_m = _pairs(ways)
    # Who has the other more in front of it brakes, and the other one only if that does not do.
    faces, faced = _in_front(ways, one, other), _in_front(ways, other, one)
    swap = faced > faces
    first, second = np.where(swap, other, one), np.where(swap, one, other)
    last_resort = np.where(np.minimum(faces, faced) > 0.0, second, count)
    while True:
        meets = ways.meet(first, second, must, room_m).any(axis=1)
        who = np.where(must[first] | (first == count), last_resort, first)[meets]
        who = who[(who < count) & ~must[who]]
        if not len(who):
            return must[:-1]
        must[who] = True


def _ways(traffic: Traffic, car: EgoBoxes, decel_mps2: Array) -> _Ways:
    """Return the ways to rest of R road users and, as the last, of the car, straight on."""
    arc_m, speed_mps, accel_mps2 = (one[0] for one in traffic.motion)
    speeds = np.append(speed_mps, max(float(car.speed_mps[0]), 0.0))
    decel = np.append(np.maximum(decel_mps2, 0.1), MAX_DECEL_MPS2)
    after_s = np.arange(0.0, float((speeds / decel).max()) + STEP_S + _EVERY_S, _EVERY_S)
    on = np.maximum(speeds + np.append(accel_mps2, 0.0) * STEP_S, 0.0)
    stepped_m = 0.5 * (speeds + on) * STEP_S
    rest_s = np.maximum(after_s - STEP_S, 0.0)
    goes_on = np.where(after_s > 0.0, stepped_m[:, None] + _braked_m(on, decel, rest_s), 0.0)
    made_m = np.stack([goes_on, _braked_m(speeds, decel, after_s)])
    poses = np.empty((*made_m.shape, 3))
    poses[:, :-1] = traffic.poses_at(arc_m[:, None] + made_m[:, :-1])
    x, y, yaw = car.poses[0]
    poses[:, -1] = np.array([x, y, yaw])
    poses[:, -1, :, :2] += made_m[:, -1, :, None] * [np.cos(yaw), np.sin(yaw)]
    crowd = traffic.crowd
    sizes = np.stack([crowd.length_m[0], crowd.width_m[0]], axis=1)
    return _Ways(poses, np.vstack([sizes, [car.length_m, car.width_m]]))


def _braked_m(speed_mps: Array, decel_mps2: Array, after_s: Array) -> Array:
    """Return (N, T) how far who brakes (N,) has come after so long (T,)."""
    held_s = np.minimum(after_s, (speed_mps / decel_mps2)[:, None])
    return np.asarray(speed_mps[:, None] * held_s - 0.5 * decel_mps2[:, None] * held_s**2)


def _pairs(ways: _Ways) -> tuple[Indices, Indices, Array]:
    """Return those who may meet (P,), (P,), and by how much their boxes count as larger (P, 2).

    Who touches already drives on, so that they come apart; who is close has its own size alone.
    """
    here = ways.poses[0, :, 0, :2]
    made_m = np.hypot(*(ways.poses[0, :, -1, :2] - here).T)
    reach_m = made_m + np.hypot(*(ways.size_m + _ROOM_M).T) / 2.0
    away_m = np.hypot(*(here[:, None] - here[None]).transpose(2, 0, 1))
    one, other = np.nonzero(np.triu(away_m < reach_m[:, None] + reach_m, 1))
    nobody = np.zeros(len(ways.size_m), dtype=bool)
    now = _Ways(ways.poses[:, :, :1], ways.size_m)
    # No more room than way: else who stands beside another and has room to get past stays there.
    room_m = np.minimum(_ROOM_M, (made_m[one] + made_m[other])[:, None])
    close = now.meet(one, other, nobody, room_m)[:, 0]
    touch = now.meet(one, other, nobody, 0.0 * room_m)[:, 0]
    room_m = np.where(close[:, None], 0.0, room_m)
    return one[~touch], other[~touch], room_m[~touch]


def _in_front(ways: _Ways, one: Indices, other: Indices) -> Array:
    """Return (P,) the cosines of the angles between where ones point and where the others are."""
    (x, y, yaw), there = ways.poses[0, one, 0].T, ways.poses[0, other, 0]
    dx, dy = there[:, 0] - x, there[:, 1] - y
    return np.asarray((np.cos(yaw) * dx + np.sin(yaw) * dy) / np.maximum(np.hypot(dx, dy), 1e-6))
