"""Post-encroachment time: how narrowly two road users miss each other where their ways cross."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from contracts.arrays import Array
from sim_worker.metrics.rollout import Measure
from sim_worker.metrics.scene import Scene

_CHUNK = 8
"""Steps whose bounding boxes are compared before their lines are."""
_PARALLEL_SIN = 0.17
"""Ways that never differ by 10° follow or meet each other; they do not cross."""
_HALF_STEP = 0.5 + 1e-9
Indices = npt.NDArray[np.intp]


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


def post_encroachment_time(scene: Scene) -> Measure:
    """Least post-encroachment time (S,); infinite where no tracks cross, 0 where both meet there.

    From the moment the first leaves the other's path until that other reaches the first one's:
    Allen, Shin and Cooper (1978), Analysis of traffic conflicts and collisions. A path is the
    strip as wide as the road user, straight around the crossing; who is on it is told by the
    oriented outlines. Both must pass within the rollout.
    """
    found = scene.keep(crossings)
    _, _, yaw, _ = scene.users
    half_length, half_width = scene.user_half_m
    x, y, _, _ = scene.users
    future, user = found.future, found.user
    ego_cos, ego_sin = scene.heading
    ego = _Outline(
        scene.centre_m[future], ego_cos[future], ego_sin[future],
        np.full(len(future), scene.half_length_m), np.full(len(future), scene.half_width_m),
    )  # fmt: skip
    heading = yaw[future, :, user]
    other = _Outline(
        np.stack([x[future, :, user], y[future, :, user]], axis=-1),
        np.cos(heading), np.sin(heading),
        half_length[future, 0, user], half_width[future, 0, user],
    )  # fmt: skip
    ego_from, ego_until = _on_strip(
        ego, found.point_m, found.user_way, other.half_width_m, found.ego_step, scene.time_s
    )
    other_from, other_until = _on_strip(
        other, found.point_m, found.ego_way, ego.half_width_m, found.user_step, scene.time_s
    )
    between = np.maximum(np.maximum(other_from - ego_until, ego_from - other_until), 0.0)
    least = np.full(len(scene.valid), np.inf)
    np.minimum.at(least, future, between)
    return scene.measure(least)


class _Outline(NamedTuple):
    """K moving boxes: centres (K, N, 2), cosine and sine of yaw (K, N), half sizes (K,)."""

    centre_m: Array
    cos: Array
    sin: Array
    half_length_m: Array
    half_width_m: Array


def _on_strip(
    box: _Outline, point_m: Array, way: Array, half_width_m: Array, step: Indices, time_s: Array
) -> tuple[Array, Array]:
    """Return when (K,) boxes come onto and leave strips through points along `way` (K, 2).

    Only the stay that includes the step after `step` (K,) counts; a box that is on the strip at
    the first instant came at that time, one that is at the last never leaves.
    """
    normal_x, normal_y = -way[:, 1, None], way[:, 0, None]
    aside = (box.centre_m[..., 0] - point_m[:, :1]) * normal_x
    aside += (box.centre_m[..., 1] - point_m[:, 1:]) * normal_y
    reach = half_width_m[:, None] + box.half_length_m[:, None] * np.abs(
        box.cos * normal_x + box.sin * normal_y
    )
    reach += box.half_width_m[:, None] * np.abs(box.cos * normal_y - box.sin * normal_x)
    off = np.abs(aside) >= reach
    index = np.arange(len(time_s))
    last_off = np.where(off & (index <= step[:, None]), index, -1).max(axis=1)
    next_off = np.where(off & (index > step[:, None]), index, len(time_s)).min(axis=1)
    came = _edge_time(aside, reach, np.maximum(last_off, 0), 1, time_s)
    left = _edge_time(aside, reach, np.minimum(next_off, len(time_s) - 1), -1, time_s)
    came = np.where(last_off < 0, time_s[0], came)
    return came, np.where(next_off == len(time_s), np.inf, left)


def _edge_time(aside: Array, reach: Array, off: Indices, toward: int, time_s: Array) -> Array:
    """Return when (K,), between instants `off` and `off + toward`, |aside| equals `reach`."""
    row = np.arange(len(off))
    on = np.clip(off + toward, 0, len(time_s) - 1)
    side = np.sign(aside[row, off])
    gap_off = side * aside[row, off] - reach[row, off]
    gap_on = side * aside[row, on] - reach[row, on]
    fall = gap_off - gap_on
    share = gap_off / np.where(fall > 0.0, fall, np.inf)
    return np.asarray(time_s[off] + share * (time_s[on] - time_s[off]))


def crossings(scene: Scene) -> Crossings:
    """Return where the ego's track crosses road users' tracks at an angle of 10° or more."""
    future, user, ego_chunk, user_chunk = _near_chunks(scene)
    instants = len(scene.time_s)
    users = scene.there.shape[2]
    # Pairs on the last axis: numpy is slow where the last axis is short.
    node = np.arange(_CHUNK + 1)[:, None]
    i = np.minimum(ego_chunk * _CHUNK + node, instants - 1)
    j = np.minimum(user_chunk * _CHUNK + node, instants - 1)
    ego = scene.centre_m.reshape(-1, 2)[future * instants + i]
    ego_x, ego_y = ego[..., 0].copy(), ego[..., 1].copy()
    place = (future * instants + j) * users + user
    x, y, there = (v.reshape(-1)[place] for v in (*scene.users[:2], scene.there))
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


def _near_chunks(scene: Scene) -> tuple[Indices, Indices, Indices, Indices]:
    """Return future, user, ego chunk and user chunk of all stretches that may cross."""
    x, y, _, _ = scene.users
    ego = _bounds(scene.centre_m[..., 0], scene.centre_m[..., 1])
    user = _bounds(x, y)
    meet = ego.least_x[:, :, None, None] <= user.most_x[:, None]
    meet &= ego.most_x[:, :, None, None] >= user.least_x[:, None]
    meet &= ego.least_y[:, :, None, None] <= user.most_y[:, None]
    meet &= ego.most_y[:, :, None, None] >= user.least_y[:, None]
    found = np.flatnonzero(meet)
    future, ego_chunk, user_chunk, who = np.unravel_index(found, meet.shape)
    own_yaw, yaw = scene.states[..., 2], scene.users[2]
    last = len(scene.time_s) - 1
    turned = [
        yaw[future, np.minimum(user_chunk * _CHUNK + j, last), who]
        - own_yaw[future, np.minimum(ego_chunk * _CHUNK + i, last)]
        for i in (0, _CHUNK)
        for j in (0, _CHUNK)
    ]
    steep = np.any([np.abs(np.sin(angle)) >= _PARALLEL_SIN for angle in turned], axis=0)
    return future[steep], who[steep], ego_chunk[steep], user_chunk[steep]


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

    return _Bounds(
        extreme(x, np.minimum), extreme(x, np.maximum),
        extreme(y, np.minimum), extreme(y, np.maximum),
    )  # fmt: skip
