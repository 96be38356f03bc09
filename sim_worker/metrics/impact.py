"""Clearance to road users, the first touch with one of them, and how hard it is."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from foretwin.contracts.arrays import Array
from foretwin.geometry.rectangles import Rectangles, clearance
from foretwin.sim_worker.driver_model import MAX_CLOSING_MPS
from foretwin.sim_worker.metrics.rollout import Flags, Measure
from foretwin.sim_worker.metrics.scene import Scene
from foretwin.sim_worker.metrics.time_to_collision import Pairs, meeting

_STANDS_MPS = 0.05
"""An ego slower than this stands: nuPlan, no_ego_at_fault_collisions."""
Indices = npt.NDArray[np.intp]


class Impacts(NamedTuple):
    """The first touch of each future (S,), NaN (user -1) where `collided` is false.

    `time_s` since the first instant; `impact_mps` the ego's speed; `closing_mps` the speed of one
    relative to the other; `at_fault` false where the ego stands, or the other's middle is behind
    its rear axle.
    """

    collided: Flags
    time_s: Array
    user: Indices
    impact_mps: Array
    closing_mps: Array
    at_fault: Flags


def minimum_clearance(scene: Scene) -> Measure:
    """Least distance (S,) between the ego's outline and anybody's, infinite where nobody is there.

    Boxes are at least as far apart as their centres less the half diagonals, and at most as their
    centres less the half widths: only pairs that can be the nearest are measured. 0 where they
    touch, be it between instants.
    """
    distance = scene.centre_distance_m
    half_length, half_width = scene.user_half_m
    touched = scene.keep(impacts).collided
    ego_diagonal = np.hypot(scene.half_length_m, scene.half_width_m)
    least = distance - (np.hypot(half_length, half_width) + ego_diagonal)
    inner = np.minimum(half_length, half_width) + min(scene.half_length_m, scene.half_width_m)
    most = (distance - inner).min(axis=(1, 2), initial=np.inf)
    most[touched] = -np.inf
    users = least.shape[2]
    pair = np.flatnonzero((least <= most[:, None, None]) & scene.there)
    row, user = np.divmod(pair, max(users, 1))
    future = row // len(scene.time_s)
    x, y, yaw, _ = (values.reshape(-1)[pair] for values in scene.users)
    apart = clearance(
        Rectangles(
            scene.centre_m.reshape(-1, 2)[row], scene.states[..., 2].reshape(-1)[row],
            2.0 * scene.half_length_m, 2.0 * scene.half_width_m,
        ),
        Rectangles(
            np.stack([x, y], axis=-1), yaw,
            2.0 * half_length[future, 0, user], 2.0 * half_width[future, 0, user],
        ),
    )  # fmt: skip
    found = np.where(touched, 0.0, np.inf)
    np.minimum.at(found, future, apart)
    return scene.measure(found)


def collided(scene: Scene) -> Measure:
    """Whether the ego touches a road user (S,): 1 or 0."""
    return scene.measure(scene.keep(impacts).collided.astype(np.float64))


def at_fault_collision(scene: Scene) -> Measure:
    """Whether the ego drives into a road user (S,): 1 or 0; see `Impacts.at_fault`."""
    return scene.measure(scene.keep(impacts).at_fault.astype(np.float64))


def collision_time(scene: Scene) -> Measure:
    """Seconds until the first touch (S,), invalid where there is none."""
    found = scene.keep(impacts)
    return scene.measure(found.time_s, found.collided)


def impact_speed(scene: Scene) -> Measure:
    """The ego's speed at the first touch (S,), invalid where there is none."""
    found = scene.keep(impacts)
    return scene.measure(found.impact_mps, found.collided)


def closing_speed(scene: Scene) -> Measure:
    """Speed of one relative to the other at the first touch (S,), invalid where there is none."""
    found = scene.keep(impacts)
    return scene.measure(found.closing_mps, found.collided)


def delta_v(scene: Scene) -> Measure:
    """Change of the ego's velocity (S,) if both went on as one body from the first touch.

    Plastic and central: m_other / (m_ego + m_other) times the relative speed; Shelby (2011),
    Delta-V as a measure of traffic conflict severity, equation 1. A simulated accident replaces
    this estimate. Invalid where nothing is hit or the other's mass is unknown.
    """
    found, masses = scene.keep(impacts), scene.context.user_mass_kg
    if masses is None:
        raise ValueError("delta-v needs the road users' masses")
    if not masses.shape[1]:
        return scene.measure(found.closing_mps, found.collided)
    other = masses[np.arange(len(masses)), np.maximum(found.user, 0)]
    share = other / (other + scene.rollout.vehicle.mass_kg.value)
    return scene.measure(found.closing_mps * share, found.collided & np.isfinite(other))


def impacts(scene: Scene) -> Impacts:
    """Return the first touch of each future; between instants both move straight and evenly.

    How a box is turned is taken from the instant before; a touch that only the turn between two
    instants brings about is found at the later one.
    """
    seen = scene.relative
    _, instants, users = seen.ahead_m.shape
    reach = np.hypot(*scene.user_half_m) + np.hypot(scene.half_length_m, scene.half_width_m)
    step_m = MAX_CLOSING_MPS * float(np.diff(scene.time_s).max())
    pair = np.flatnonzero(scene.centre_distance_m < reach + step_m)
    row, user = np.divmod(pair, max(users, 1))
    instant = row % instants
    # Where there is no next instant, or nobody at it, nothing moves.
    goes_on = instant < instants - 1
    next_row, next_pair = row + goes_on, pair + users * goes_on
    both, then = (scene.there.reshape(-1)[which] for which in (pair, next_pair))
    next_row, next_pair = np.where(then, next_row, row), np.where(then, next_pair, pair)
    x, y = (values.reshape(-1) for values in scene.users[:2])
    ego_x, ego_y = (np.ascontiguousarray(scene.centre_m[..., k]).reshape(-1) for k in range(2))
    move_x = x[next_pair] - x[pair] - (ego_x[next_row] - ego_x[row])
    move_y = y[next_pair] - y[pair] - (ego_y[next_row] - ego_y[row])
    gap = scene.centre_distance_m.reshape(-1)[pair] - reach[row // instants, 0, user]
    near = np.flatnonzero(both & (gap <= np.abs(move_x) + np.abs(move_y)))
    pair, row, user, instant = pair[near], row[near], user[near], instant[near]
    move_x, move_y, goes_on, future = move_x[near], move_y[near], goes_on[near], row // instants
    cos, sin = (values.reshape(-1)[row] for values in scene.heading)
    half_length, half_width = scene.user_half_m
    touch = meeting(
        Pairs(
            seen.ahead_m.reshape(-1)[pair], seen.left_m.reshape(-1)[pair],
            cos * move_x + sin * move_y, cos * move_y - sin * move_x,
            seen.cos.reshape(-1)[pair], seen.sin.reshape(-1)[pair],
            (scene.half_length_m, scene.half_width_m),
            (half_length[future, 0, user], half_width[future, 0, user]),
        )
    )  # fmt: skip
    # In units of the step: 0 at this instant, 1 at the next.
    share = np.maximum(touch.from_s, 0.0)
    hit = (touch.from_s <= touch.until_s) & (touch.until_s >= 0.0)
    hit &= share < np.where(goes_on, 1.0, 1e-300)
    return _first(scene, future[hit], instant[hit], user[hit], share[hit])


def _first(scene: Scene, future: Indices, instant: Indices, user: Indices, share: Array) -> Impacts:
    futures, instants = scene.states.shape[:2]
    order = np.lexsort((user, instant + share, future))
    who, first = np.unique(future[order], return_index=True)
    chosen = order[first]
    instant, user, share = instant[chosen], user[chosen], share[chosen]
    after = np.minimum(instant + 1, instants - 1)
    begin, end = scene.time_s[instant], scene.time_s[after]
    state = scene.states[who, instant]
    motion = state[:, 3:5] + share[:, None] * (scene.states[who, after, 3:5] - state[:, 3:5])
    _, _, yaw, speed = scene.users
    other_mps = speed[who, instant, user]
    turned = yaw[who, instant, user] - state[:, 2]
    relative = other_mps[:, None] * np.stack([np.cos(turned), np.sin(turned)], axis=-1) - motion
    impact = np.hypot(motion[:, 0], motion[:, 1])
    ahead = scene.relative.ahead_m[who, instant, user] + scene.centre_ahead_m

    def spread(values: Array, without: float) -> Array:
        found = np.full(futures, without)
        found[who] = values
        return found

    return Impacts(
        collided=spread(np.ones(len(who)), 0.0) > 0.0,
        time_s=spread(begin + share * (end - begin), np.nan) - scene.time_s[0],
        user=spread(user.astype(np.float64), -1.0).astype(np.intp),
        impact_mps=spread(impact, np.nan),
        closing_mps=spread(np.hypot(relative[:, 0], relative[:, 1]), np.nan),
        at_fault=spread(((impact > _STANDS_MPS) & (ahead > 0.0)).astype(np.float64), 0.0) > 0.0,
    )
