"""When a car first touches another road user: rectangles that move between control ticks.

Motion between ticks is taken as straight and even. Overlaps are looked for every 10 ms and then
narrowed down to `_PRECISION_S`; a touch that begins and ends within 10 ms may be missed.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array, Flags, Indices
from foretwin.contracts.frames import wrap_angle
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.geometry.rectangles import (
    Rectangles,
    corners,
    depth_within,
    overlapping,
    separations,
)
from foretwin.sim_worker.driver_model import MAX_CLOSING_MPS
from foretwin.sim_worker.vehicle.reference_points import box_centre_from_base_m

_SEARCH_STEP_S = 0.01
_PRECISION_S = 1e-5
_FUTURES_AT_ONCE = 8
_TOUCHING_M = 0.02
"""Corners this near to the other's outline count as touching it."""


class Touches(NamedTuple):
    """The first touch of each future that has one: A of them, in the order of futures.

    `future` (A,) and `user` (A,) say who; `time_s` (A,) since the first instant, the last one
    before the two overlap. `ego_states` (A, 8) of base_link; `user_poses` (A, 3) x, y, yaw of the
    box centre, `user_velocities` (A, 3) in the same frame, yaw rate last, `user_size_m` (A, 2).
    `point_m` (A, 2) where they touch; `normal` (A, 2) the unit vector across the touching faces,
    from the ego to the other. `from_start` (A,): they overlapped at the first instant already, or
    the other appeared inside the ego: there is a touch, but no impact to compute.
    """

    future: Indices
    user: Indices
    time_s: Array
    ego_states: Array
    user_poses: Array
    user_velocities: Array
    user_size_m: Array
    point_m: Array
    normal: Array
    from_start: Flags


def first_touches(
    vehicle: VehicleParameters, states: Array, users: Array, user_size_m: Array, *, tick_s: float
) -> Touches:
    """Find the first touch of each of S futures with any of R road users.

    `states` (S, T, 8) of base_link at control ticks, `users` (S, T, R, 3) x, y, yaw of box
    centres, NaN where absent, `user_size_m` (S, R, 2) length and width.
    """
    motion = _may_touch(vehicle, states, users, user_size_m, tick_s=tick_s)
    steps = _steps(tick_s)
    if not len(motion.future):
        return _describe(motion, np.zeros(0), 1.0 / steps, tick_s)
    # What comes after a tick that ends in a touch does not matter.
    ends = np.full(len(states), states.shape[1])
    overlapped = motion.overlapping(np.ones(1))
    np.minimum.at(ends, motion.future[overlapped], motion.tick[overlapped])
    motion = motion.only(np.flatnonzero(motion.tick <= ends[motion.future]))
    share = np.arange(steps + 1.0) / steps
    touching = motion.overlapping(share[:, None])
    hit = np.flatnonzero(touching.any(axis=0))
    step = touching[:, hit].argmax(axis=0)
    order = np.lexsort((motion.user[hit], step, motion.tick[hit], motion.future[hit]))
    _, first = np.unique(motion.future[hit][order], return_index=True)
    chosen = order[first]
    return _describe(motion.only(hit[chosen]), step[chosen] / steps, 1.0 / steps, tick_s)


def touched(
    vehicle: VehicleParameters, states: Array, users: Array, user_size_m: Array, *, tick_s: float
) -> Flags:
    """Return which of S futures `first_touches` finds a touch in: (S,) bool, without details."""
    motion = _may_touch(vehicle, states, users, user_size_m, tick_s=tick_s)
    found = np.zeros(len(states), dtype=bool)
    if len(motion.future):
        share = np.arange(_steps(tick_s) + 1.0) / _steps(tick_s)
        found[motion.future[motion.overlapping(share[:, None]).any(axis=0)]] = True
    return found


def _may_touch(
    vehicle: VehicleParameters, states: Array, users: Array, user_size_m: Array, *, tick_s: float
) -> _Motion:
    """Return the pairs that are not farther apart than they can move towards each other."""
    near = _near(vehicle, states, users, user_size_m, tick_s=tick_s)
    motion = _Motion(vehicle, states, users, user_size_m, *near)
    if not len(motion.future):
        return motion
    gap = separations(*motion.rectangles(np.zeros(1))).max(axis=0)
    reach = math.hypot(vehicle.length_m.value, vehicle.width_m.value)
    travel = np.hypot(motion.state_change[:, 0], motion.state_change[:, 1])
    travel += reach * np.abs(motion.state_change[:, 2])
    travel += np.hypot(motion.pose_change[:, 0], motion.pose_change[:, 1])
    travel += motion.size_m.max(axis=1, initial=0.0) * np.abs(motion.pose_change[:, 2])
    return motion.only(np.flatnonzero(gap <= travel))


def _steps(tick_s: float) -> int:
    """Return how many parts of a tick are looked at for overlaps."""
    return max(math.ceil(tick_s / _SEARCH_STEP_S - 1e-9), 1)


class _Motion:
    """Ego and one road user from one tick to the next, for K pairs of them."""

    def __init__(
        self,
        vehicle: VehicleParameters,
        states: Array,
        users: Array,
        user_size_m: Array,
        future: Indices,
        tick: Indices,
        user: Indices,
    ) -> None:
        self.vehicle, self.future, self.tick, self.user = vehicle, future, tick, user
        self._all = (vehicle, states, users, user_size_m)
        after = np.minimum(tick + 1, states.shape[1] - 1)
        self.state = states[future, tick]
        self.state_change = states[future, after] - self.state
        self.state_change[:, 2] = wrap_angle(self.state_change[:, 2])
        self.pose = users[future, tick, user]
        change = users[future, after, user] - self.pose
        change[:, 2] = wrap_angle(change[:, 2])
        # Who is absent at the next tick stays where it was last seen.
        self.pose_change = np.where(np.isfinite(change), change, 0.0)
        self.size_m = user_size_m[future, user]

    def only(self, rows: Indices) -> _Motion:
        return _Motion(*self._all, self.future[rows], self.tick[rows], self.user[rows])

    def at(self, share: Array) -> tuple[Array, Array]:
        """Return ego states (…, K, 8) and user poses (…, K, 3) at a share (…, K) of the tick."""
        return (
            self.state + share[..., None] * self.state_change,
            self.pose + share[..., None] * self.pose_change,
        )

    def rectangles(self, share: Array) -> tuple[Rectangles, Rectangles]:
        state, pose = self.at(share)
        return (
            ego_rectangles(self.vehicle, state),
            Rectangles(pose[..., :2], pose[..., 2], self.size_m[:, 0], self.size_m[:, 1]),
        )

    def overlapping(self, share: Array) -> Flags:
        return overlapping(*self.rectangles(share))


def ego_rectangles(vehicle: VehicleParameters, states: Array) -> Rectangles:
    """Return the car's outline at base_link states (…, 8)."""
    ahead = box_centre_from_base_m(vehicle)
    yaw = states[..., 2]
    centre = np.empty((*yaw.shape, 2))
    centre[..., 0] = states[..., 0] + ahead * np.cos(yaw)
    centre[..., 1] = states[..., 1] + ahead * np.sin(yaw)
    return Rectangles(centre, yaw, vehicle.length_m.value, vehicle.width_m.value)


def _near(
    vehicle: VehicleParameters, states: Array, users: Array, user_size_m: Array, *, tick_s: float
) -> tuple[Indices, Indices, Indices]:
    """Return future, tick and user of all pairs whose circles may meet before the next tick."""
    if not users.size:
        return (np.zeros(0, dtype=np.intp),) * 3
    radius = np.hypot(user_size_m[..., 0], user_size_m[..., 1]) / 2.0
    reach = radius + math.hypot(vehicle.length_m.value, vehicle.width_m.value) / 2.0
    reach += MAX_CLOSING_MPS * tick_s
    reach_square = np.square(reach)
    centre = ego_rectangles(vehicle, states).centre_m
    near = []
    # Some futures at a time: fresh memory for all at once takes longer than the arithmetic, and so
    # does nonzero on three axes.
    pairs = states.shape[1] * users.shape[2]
    for first in range(0, max(len(states), 1), _FUTURES_AT_ONCE):
        rows = slice(first, first + _FUTURES_AT_ONCE)
        distance = users[rows, :, :, 0] - centre[rows, :, None, 0]
        np.square(distance, out=distance)
        across = users[rows, :, :, 1] - centre[rows, :, None, 1]
        np.square(across, out=across)
        distance += across
        close = np.flatnonzero(distance < reach_square[rows, None])
        near.append(close + first * pairs)
    future, tick, user = np.unravel_index(np.concatenate(near), users.shape[:3])
    return future, tick, user


def _describe(motion: _Motion, share: Array, step: float, tick_s: float) -> Touches:
    """Narrow down touches that begin within the `step` before `share` (A,) of their ticks."""
    from_start = share <= 0.0
    early, late = np.maximum(share - step, 0.0), share.copy()
    halvings = max(math.ceil(math.log2(step * tick_s / _PRECISION_S)), 0)
    for _ in range(halvings if len(share) else 0):
        middle = (early + late) / 2.0
        touching = motion.overlapping(middle)
        late = np.where(touching, middle, late)
        early = np.where(touching, early, middle)
    states, poses = motion.at(early)
    ego, user = motion.rectangles(late)
    return Touches(
        future=motion.future,
        user=motion.user,
        time_s=np.asarray((motion.tick + early) * tick_s, dtype=np.float64),
        ego_states=states,
        user_poses=poses,
        user_velocities=motion.pose_change / tick_s,
        user_size_m=motion.size_m,
        point_m=_touching_point_m(ego, user),
        normal=_normal(*motion.rectangles(early)),
        from_start=from_start,
    )


def _touching_point_m(ego: Rectangles, user: Rectangles) -> Array:
    """Return (A, 2) the middle of the corners of either that lie on the other's outline.

    That is the corner where a corner meets a face, and the middle of the line that two faces
    share; where no corner touches, halfway between the centres.
    """
    own, others = corners(ego), corners(user)
    inside = np.concatenate([depth_within(own, user), depth_within(others, ego)], axis=-1)
    weight = (inside > -_TOUCHING_M).astype(np.float64)
    found = weight.sum(axis=-1, keepdims=True)
    points = np.concatenate([own, others], axis=-2)
    mean = (weight[..., None] * points).sum(axis=-2) / np.maximum(found, 1.0)
    return np.where(found > 0.0, mean, (ego.centre_m + user.centre_m) / 2.0)


def _normal(ego: Rectangles, user: Rectangles) -> Array:
    """Return (A, 2) the axis of the widest gap, pointing from the ego to the road user."""
    axis = separations(ego, user).argmax(axis=0)
    angle = np.where(axis < 2, ego.yaw_rad, user.yaw_rad) + np.where(axis % 2, np.pi / 2, 0.0)
    normal = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    between = user.centre_m - ego.centre_m
    sign = np.where((normal * between).sum(axis=-1) < 0.0, -1.0, 1.0)
    return np.asarray(normal * sign[..., None])
