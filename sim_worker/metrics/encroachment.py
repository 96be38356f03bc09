"""Encroachment: how narrowly two road users miss each other where their ways cross, and how long
and from how far the ego gets in the way."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array, Indices
from foretwin.sim_worker.metrics import compiled_pairs
from foretwin.sim_worker.metrics.impact import impacts
from foretwin.sim_worker.metrics.rollout import Measure, RolloutView

_CHUNK = 8
"""Steps whose bounding boxes are compared before their lines are."""
_PARALLEL_SIN = 0.17
"""Ways that never differ by 10° follow or meet each other; they do not cross."""
_HALF_STEP = 0.5 + 1e-9
STOPPING_DECEL_MPS2 = 3.4
"""Deceleration that most drivers accept: AASHTO (2018), A Policy on Geometric Design, 3.2.2."""


class Crossings(NamedTuple):
    """K places where the ego's track crosses that of a road user.

    `future` (K,), `user` (K,); `ego_step` and `user_step` (K,) the instants before;
    `point_m` (K, 2); unit `ego_way` and `user_way` (K, 2).
    """

    future: Indices
    user: Indices
    ego_step: Indices
    user_step: Indices
    point_m: Array
    ego_way: Array
    user_way: Array


class Stays(NamedTuple):
    """When each is on the other's strip at K crossings (K,): from when until when.

    Who is on it at the first instant came then, who is at the last leaves never; NaN for somebody
    whose track begins or ends on it. A strip is as wide as the road user, straight around the
    crossing; the oriented outlines say who is on it.
    """

    ego_from_s: Array
    ego_until_s: Array
    user_from_s: Array
    user_until_s: Array


def post_encroachment_time(view: RolloutView) -> Measure:
    """Least post-encroachment time (S,); infinite where no tracks cross, 0 where both meet there.

    From the moment the first leaves the other's path until that other reaches the first one's:
    Allen, Shin and Cooper (1978), Analysis of traffic conflicts and collisions. A path is the strip
    of `Stays`. Both must pass within the rollout. Invalid where all that could tell are lost from
    sight on the ego's path.
    """
    at, future = view.keep(stays), view.keep(crossings).future
    after, before = at.user_from_s - at.ego_until_s, at.ego_from_s - at.user_until_s
    between = np.maximum(np.fmax(after, before), 0.0)
    said = (between > 0.0) | ~np.isnan(after + before)
    least = np.full(len(view.valid), np.inf)
    np.minimum.at(least, future[said], between[said])
    least[_met(view)] = 0.0
    unsaid = np.zeros(len(least), dtype=bool)
    unsaid[future[~said]] = True
    return view.measure(least, ~(unsaid & np.isinf(least)))


def encroachment_time(view: RolloutView) -> Measure:
    """Longest time (S,) for which the ego is on the path of a road user whose track it crosses.

    Allen, Shin and Cooper (1978), Analysis of traffic conflicts and collisions. Invalid where it
    crosses none, or does not leave all of those paths within the rollout.
    """
    at = view.keep(stays)
    longest = np.full(len(view.valid), -np.inf)
    np.maximum.at(longest, view.keep(crossings).future, at.ego_until_s - at.ego_from_s)
    return view.measure(longest, np.isfinite(longest))


def proportion_of_stopping_distance(view: RolloutView) -> Measure:
    """Least way that is left at the first instant to a path that it will cross (S,), infinite
    without one, as a multiple of the way in which the ego can stop.

    Allen, Shin and Cooper (1978), Analysis of traffic conflicts and collisions. Below 1 the ego
    cannot stop before it without braking harder than `STOPPING_DECEL_MPS2`. Of later instants it
    tells nothing: who drives onto a path has no way left to it at last.
    """
    moved = np.diff(view.centre_m, axis=1)
    gone_m = np.zeros(view.states.shape[:2])
    np.cumsum(np.hypot(moved[..., 0], moved[..., 1]), axis=1, out=gone_m[:, 1:])
    future, at_s = view.keep(crossings).future, view.keep(stays).ego_from_s
    after = np.clip(np.searchsorted(view.time_s, at_s), 1, len(view.time_s) - 1)
    begin_s, end_s = view.time_s[after - 1], view.time_s[after]
    share = (at_s - begin_s) / (end_s - begin_s)
    left_m = gone_m[future, after - 1] * (1.0 - share) + gone_m[future, after] * share
    stop_m = np.square(view.speed_mps[future, 0]) / (2.0 * STOPPING_DECEL_MPS2)
    least = np.full(len(view.valid), np.inf)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(left_m > 0.0, left_m / stop_m, 0.0)
    np.minimum.at(least, future, ratio)
    return view.measure(least)


def stays(view: RolloutView) -> Stays:
    """Return when both are on each other's strips, at each of `crossings`."""
    found = view.keep(crossings)
    future, user = found.future, found.user
    half_m = tuple(half[future, 0, user] for half in view.user_half_m)
    own_half_m = tuple(np.full(len(future), half) for half in view.half_m)
    x, y, yaw = (v[..., None] for v in (*np.moveaxis(view.centre_m, 2, 0), view.states[..., 2]))
    own_picked = (future, np.zeros_like(user), found.ego_step)
    picked = (future, user, found.user_step)
    stay_s = np.empty((4, len(future)))
    lasts = np.full(len(view.valid), len(view.time_s) - 1)
    if view.counts is not None:
        lasts = view.counts.sum(axis=1) - 1
    always = np.ones(x.shape, dtype=bool)
    for poses, half, which, there, way, strip_half, stay in (
        ((x, y, yaw), own_half_m, own_picked, always, found.user_way, half_m[1], stay_s[:2]),
        (view.users[:3], half_m, picked, view.there, found.ego_way, own_half_m[1], stay_s[2:]),
    ):
        compiled_pairs.stays_on_strips(
            poses, half, which, there, lasts, found.point_m, way, strip_half, view.time_s, stay
        )
    return Stays(*stay_s)


def _met(view: RolloutView) -> Indices:
    """Return the futures (K,) in which the ego hits a road user whose way it crosses."""
    found = view.keep(impacts)
    future = np.flatnonzero(np.isfinite(found.time_s))
    at_s = view.time_s[0] + found.time_s[future]
    before = np.maximum(np.searchsorted(view.time_s, at_s, side="right") - 1, 0)
    turned = view.users[2][future, before, found.user[future]] - view.states[future, before, 2]
    crossing: Indices = future[np.abs(np.sin(turned)) >= _PARALLEL_SIN]
    return crossing


def crossings(view: RolloutView) -> Crossings:
    """Return where the ego's track crosses road users' tracks at an angle of 10° or more."""
    future, user, ego_chunk, user_chunk = _near_chunks(view)
    instants = len(view.time_s)
    users = view.there.shape[2]
    # Pairs on the last axis: numpy is slow where the last axis is short.
    node = np.arange(_CHUNK + 1)[:, None]
    i = np.minimum(ego_chunk * _CHUNK + node, instants - 1)
    j = np.minimum(user_chunk * _CHUNK + node, instants - 1)
    ego = view.centre_m.reshape(-1, 2)[future * instants + i]
    ego_x, ego_y = ego[..., 0].copy(), ego[..., 1].copy()
    place = (future * instants + j) * users + user
    x, y, there = (v.reshape(-1)[place] for v in (*view.users[:2], view.there))
    step_x, step_y = (np.diff(values, axis=0)[:, None] for values in (ego_x, ego_y))
    way_x, way_y = (np.diff(values, axis=0)[None] for values in (x, y))
    from_x, from_y = x[None, :-1] - ego_x[:-1, None], y[None, :-1] - ego_y[:-1, None]
    turn = step_x * way_y - step_y * way_x
    turn[np.abs(turn) < 1e-12] = np.nan
    along_ego = (from_x * way_y - from_y * way_x) / turn
    along_other = (from_x * step_y - from_y * step_x) / turn
    # Ends count for both neighbours: a crossing found twice does no harm, one missed does.
    cross = (np.abs(along_ego - 0.5) <= _HALF_STEP) & (np.abs(along_other - 0.5) <= _HALF_STEP)
    cross &= there[1:] & there[:-1]
    a, b, pair = np.unravel_index(np.flatnonzero(cross), cross.shape)
    ego_way = _unit(step_x[a, 0, pair], step_y[a, 0, pair])
    user_way = _unit(way_x[0, b, pair], way_y[0, b, pair])
    angle_sin = ego_way[:, 0] * user_way[:, 1] - ego_way[:, 1] * user_way[:, 0]
    steep = np.abs(angle_sin) >= _PARALLEL_SIN
    a, b, pair = a[steep], b[steep], pair[steep]
    begin = ego[a, pair]
    return Crossings(
        future=future[pair],
        user=user[pair],
        ego_step=i[a, pair],
        user_step=j[b, pair],
        point_m=begin + along_ego[a, b, pair][:, None] * (ego[a + 1, pair] - begin),
        ego_way=ego_way[steep],
        user_way=user_way[steep],
    )


def _unit(x: Array, y: Array) -> Array:
    return np.stack([x, y], axis=-1) / np.hypot(x, y)[:, None]


def _near_chunks(view: RolloutView) -> tuple[Indices, Indices, Indices, Indices]:
    """Return future, user, ego chunk and user chunk of all stretches that may cross."""
    x, y, _, _ = view.users
    ego = _bounds(view.centre_m[..., 0], view.centre_m[..., 1])
    user = _bounds(x, y)
    meet = ego.least_x[:, :, None, None] <= user.most_x[:, None]
    meet &= ego.most_x[:, :, None, None] >= user.least_x[:, None]
    meet &= ego.least_y[:, :, None, None] <= user.most_y[:, None]
    meet &= ego.most_y[:, :, None, None] >= user.least_y[:, None]
    found = np.flatnonzero(meet)
    future, ego_chunk, user_chunk, other = np.unravel_index(found, meet.shape)
    own_yaw, yaw = view.states[..., 2], view.users[2]
    last = len(view.time_s) - 1
    turned = [
        yaw[future, np.minimum(user_chunk * _CHUNK + j, last), other]
        - own_yaw[future, np.minimum(ego_chunk * _CHUNK + i, last)]
        for i in (0, _CHUNK)
        for j in (0, _CHUNK)
    ]
    steep = np.any([np.abs(np.sin(angle)) >= _PARALLEL_SIN for angle in turned], axis=0)
    return future[steep], other[steep], ego_chunk[steep], user_chunk[steep]


class _Bounds(NamedTuple):
    """Bounding boxes of the chunks of tracks: (S, C, …) each."""

    least_x: Array
    most_x: Array
    least_y: Array
    most_y: Array


def _bounds(x: Array, y: Array) -> _Bounds:
    chunks = -(-(x.shape[1] - 1) // _CHUNK)
    nodes = np.minimum(np.arange(chunks * _CHUNK + 1), x.shape[1] - 1)

    def extreme(values: Array, of: np.ufunc) -> Array:
        padded = values.take(nodes, axis=1) if len(nodes) > x.shape[1] else values
        found = of(padded[:, :-1:_CHUNK], padded[:, _CHUNK::_CHUNK])
        for k in range(1, _CHUNK):
            of(found, padded[:, k::_CHUNK], out=found)
        return np.asarray(found)

    return _Bounds(*(extreme(v, of) for v in (x, y) for of in (np.minimum, np.maximum)))
