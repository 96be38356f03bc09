"""Clearance to road users, the first touch with one of them, and how hard it is."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array, Flags, Indices
from foretwin.contracts.frames import wrap_angle
from foretwin.geometry.rectangles import Rectangles, clearance, corners
from foretwin.sim_worker.driver_model import MAX_CLOSING_MPS
from foretwin.sim_worker.metrics.rollout import Measure, RolloutView
from foretwin.sim_worker.metrics.time_to_collision import meeting

_STANDS_MPS = 0.05
"""An ego slower than this stands: nuPlan, no_ego_at_fault_collisions."""


class Impacts(NamedTuple):
    """The first touch of each future (S,), NaN (user -1) where `collided` is false.

    `time_s` since the first instant; `impact_mps` the ego's speed; `closing_mps` the speed of one
    relative to the other; `at_fault` false where the ego stands, or the other's middle is behind
    its rear axle; where it drives backwards, ahead of its front axle.
    """

    collided: Flags
    time_s: Array
    user: Indices
    impact_mps: Array
    closing_mps: Array
    at_fault: Flags


def minimum_clearance(view: RolloutView) -> Measure:
    """Least distance (S,) between the ego's outline and any other, infinite where there is none.

    Boxes are at least as far apart as their centres less the half diagonals, and at most as their
    centres less the half widths: only pairs that can be the nearest are measured. Between instants
    both move straight and evenly. 0 where they touch.
    """
    distance = view.centre_distance_m
    half_length, half_width = view.user_half_m
    touched = view.keep(impacts).collided
    ego_diagonal = np.hypot(view.half_length_m, view.half_width_m)
    least = distance - (np.hypot(half_length, half_width) + ego_diagonal)
    inner = np.minimum(half_length, half_width) + min(view.half_length_m, view.half_width_m)
    most = (distance - inner).min(axis=(1, 2), initial=np.inf)
    most[touched] = -np.inf
    users = least.shape[2]
    pair = np.flatnonzero((least <= most[:, None, None]) & view.there)
    row, user = np.divmod(pair, max(users, 1))
    future = row // len(view.time_s)
    x, y, yaw, _ = (values.reshape(-1)[pair] for values in view.users)
    centre, own_yaw = view.centre_m.reshape(-1, 2)[row], view.states[..., 2].reshape(-1)[row]
    sizes = 2.0 * half_length[future, 0, user], 2.0 * half_width[future, 0, user]
    apart = clearance(
        Rectangles(centre, own_yaw, 2.0 * view.half_length_m, 2.0 * view.half_width_m),
        Rectangles(np.stack([x, y], axis=-1), yaw, *sizes),
    )
    found = np.where(touched, 0.0, np.inf)
    np.minimum.at(found, future, apart)
    np.minimum.at(found, *_passing(view, found))
    return view.measure(found)


def _passing(view: RolloutView, least_m: Array) -> tuple[Indices, Array]:
    """Return futures (K,) and how near (K,) somebody passes between two instants, of all that may
    come nearer there than `least_m` (S,).

    With outlines turned as before, the nearest points of two that pass include a corner of each:
    where that is, the outlines are measured as they are turned then.
    """
    reach = np.hypot(*view.user_half_m) + np.hypot(view.half_length_m, view.half_width_m)
    # Within a step nobody comes nearer than at its ends by more than half of the way.
    nearer_m = MAX_CLOSING_MPS * float(np.diff(view.time_s).max()) / 2.0
    limit = np.where(least_m > 0.0, least_m + nearer_m, -np.inf)[:, None, None]
    close = (
        (view.centre_distance_m < reach + limit)[:, :-1] & view.there[:, :-1] & view.there[:, 1:]
    )
    future, instant, user = np.nonzero(close)
    at, then = (future, instant, user), (future, instant + 1, user)
    x, y, other_yaw, _ = view.users
    away = np.stack([x[at], y[at]], axis=-1) - view.centre_m[at[:2]]
    move = np.stack([x[then], y[then]], axis=-1) - view.centre_m[then[:2]] - away
    share = _nearest_share(away, move)
    middles_m = np.hypot(*(away + share[:, None] * move).T)
    may = np.flatnonzero(middles_m < reach[future, 0, user] + least_m[future])
    future, instant, user = future[may], instant[may], user[may]
    at, then = (future, instant, user), (future, instant + 1, user)
    away, move = away[may], move[may]
    size = tuple(2.0 * half[future, 0, user] for half in view.user_half_m)
    own_size = 2.0 * view.half_length_m, 2.0 * view.half_width_m
    own_yaw = view.states[..., 2]
    own = corners(Rectangles(np.zeros_like(away), own_yaw[at[:2]], *own_size))
    other = corners(Rectangles(away, other_yaw[at], *size))
    between = (other[:, :, None] - own[:, None]).reshape(len(may), 16, 2)
    shares = _nearest_share(between, move[:, None])
    square = np.square(between + shares[..., None] * move[:, None]).sum(axis=-1)
    share = shares[np.arange(len(may)), square.argmin(axis=1)]
    own_turned, other_turned = (
        begin + share * wrap_angle(end - begin)
        for begin, end in ((own_yaw[at[:2]], own_yaw[then[:2]]), (other_yaw[at], other_yaw[then]))
    )
    there = away + share[:, None] * move
    return future, clearance(
        Rectangles(np.zeros_like(away), own_turned, *own_size),
        Rectangles(there, other_turned, *size),
    )


def _nearest_share(from_m: Array, move_m: Array) -> Array:
    """Return where (…) on the ways `move_m` (…, 2) from points (…, 2) the origin is nearest."""
    square = np.square(move_m).sum(axis=-1)
    along = -(from_m * move_m).sum(axis=-1)
    return np.asarray(np.clip(along / np.where(square > 0.0, square, 1.0), 0.0, 1.0))


def collided(view: RolloutView) -> Measure:
    """Whether the ego touches a road user (S,): 1 or 0."""
    return view.measure(view.keep(impacts).collided.astype(np.float64))


def at_fault_collision(view: RolloutView) -> Measure:
    """Whether the ego drives into a road user (S,): 1 or 0; see `Impacts.at_fault`."""
    return view.measure(view.keep(impacts).at_fault.astype(np.float64))


def collision_time(view: RolloutView) -> Measure:
    """Seconds until the first touch (S,), invalid where there is none."""
    found = view.keep(impacts)
    return view.measure(found.time_s, found.collided)


def impact_speed(view: RolloutView) -> Measure:
    """The ego's speed at the first touch (S,), invalid where there is none."""
    found = view.keep(impacts)
    return view.measure(found.impact_mps, found.collided)


def closing_speed(view: RolloutView) -> Measure:
    """Speed of one relative to the other at the first touch (S,), invalid where there is none."""
    found = view.keep(impacts)
    return view.measure(found.closing_mps, found.collided)


def delta_v(view: RolloutView) -> Measure:
    """Change of the ego's velocity (S,) if both went on as one body from the first touch.

    Plastic and central: m_other / (m_ego + m_other) times the relative speed; Shelby (2011),
    Delta-V as a measure of traffic conflict severity, equation 1. It stays this estimate where an
    accident was simulated, which tells its own. Invalid where nothing is hit or the other's mass is
    unknown.
    """
    found, masses = view.keep(impacts), view.context.user_mass_kg
    if masses is None:
        raise ValueError("delta-v needs the road users' masses")
    if not masses.shape[1]:
        return view.measure(found.closing_mps, found.collided)
    other = masses[np.arange(len(masses)), np.maximum(found.user, 0)]
    share = other / (other + view.rollout.vehicle.mass_kg.value)
    return view.measure(found.closing_mps * share, found.collided & np.isfinite(other))


def impacts(view: RolloutView) -> Impacts:
    """Return the first touch of each future; between instants both move straight and evenly.

    How a box is turned is taken from the instant before; a touch that only the turn between two
    instants brings about is found at the later one.
    """
    seen = view.relative
    _, instants, users = seen.ahead_m.shape
    reach = np.hypot(*view.user_half_m) + np.hypot(view.half_length_m, view.half_width_m)
    step_m = MAX_CLOSING_MPS * float(np.diff(view.time_s).max())
    pair = np.flatnonzero(view.centre_distance_m < reach + step_m)
    row, user = np.divmod(pair, max(users, 1))
    instant = row % instants
    # Where there is no next instant, or no road user at it, nothing moves.
    goes_on = instant < instants - 1
    next_row, next_pair = row + goes_on, pair + users * goes_on
    both, then = (view.there.reshape(-1)[which] for which in (pair, next_pair))
    next_row, next_pair = np.where(then, next_row, row), np.where(then, next_pair, pair)
    x, y = (values.reshape(-1) for values in view.users[:2])
    ego_x, ego_y = (np.ascontiguousarray(view.centre_m[..., k]).reshape(-1) for k in range(2))
    move_x = x[next_pair] - x[pair] - (ego_x[next_row] - ego_x[row])
    move_y = y[next_pair] - y[pair] - (ego_y[next_row] - ego_y[row])
    gap = view.centre_distance_m.reshape(-1)[pair] - reach[row // instants, 0, user]
    near = np.flatnonzero(both & (gap <= np.abs(move_x) + np.abs(move_y)))
    pair, row, user, instant = pair[near], row[near], user[near], instant[near]
    move_x, move_y, goes_on, future = move_x[near], move_y[near], goes_on[near], row // instants
    cos, sin = (values.reshape(-1)[row] for values in view.heading)
    half_length, half_width = view.user_half_m
    position = seen.ahead_m.reshape(-1)[pair], seen.left_m.reshape(-1)[pair]
    turn = seen.cos.reshape(-1)[pair], seen.sin.reshape(-1)[pair]
    motion = cos * move_x + sin * move_y, cos * move_y - sin * move_x
    other_half_m = half_length[future, 0, user], half_width[future, 0, user]
    touch = meeting((*position, *turn, *motion), view.half_m, other_half_m)
    # In units of the step: 0 at this instant, 1 at the next.
    share = np.maximum(touch.from_s, 0.0)
    hit = (touch.from_s <= touch.until_s) & (touch.until_s >= 0.0)
    hit &= share < np.where(goes_on, 1.0, 1e-300)
    return _first(view, future[hit], instant[hit], user[hit], share[hit])


def _first(
    view: RolloutView, future: Indices, instant: Indices, user: Indices, share: Array
) -> Impacts:
    futures, instants = view.states.shape[:2]
    order = np.lexsort((user, instant + share, future))
    hit_rows, first = np.unique(future[order], return_index=True)
    chosen = order[first]
    instant, user, share = instant[chosen], user[chosen], share[chosen]
    after = np.minimum(instant + 1, instants - 1)
    begin, end = view.time_s[instant], view.time_s[after]
    state = view.states[hit_rows, instant]
    motion = state[:, 3:5] + share[:, None] * (view.states[hit_rows, after, 3:5] - state[:, 3:5])
    _, _, yaw, speed = view.users
    other_mps = speed[hit_rows, instant, user]
    turned = yaw[hit_rows, instant, user] - state[:, 2]
    relative = other_mps[:, None] * np.stack([np.cos(turned), np.sin(turned)], axis=-1) - motion
    impact = np.hypot(motion[:, 0], motion[:, 1])
    ahead = view.relative.ahead_m[hit_rows, instant, user] + view.centre_ahead_m
    ahead = ahead - view.trailing_axle_m[hit_rows, instant]
    leads = np.where(view.backs[hit_rows, instant], ahead < 0.0, ahead > 0.0)

    def spread(values: Array, without: float) -> Array:
        found = np.full(futures, without)
        found[hit_rows] = values
        return found

    return Impacts(
        collided=spread(np.ones(len(hit_rows)), 0.0) > 0.0,
        time_s=spread(begin + share * (end - begin), np.nan) - view.time_s[0],
        user=spread(user.astype(np.float64), -1.0).astype(np.intp),
        impact_mps=spread(impact, np.nan),
        closing_mps=spread(np.hypot(relative[:, 0], relative[:, 1]), np.nan),
        at_fault=spread(((impact > _STANDS_MPS) & leads).astype(np.float64), 0.0) > 0.0,
    )
