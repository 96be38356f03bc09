"""Kernels over pairs against the plain formulas, on motions drawn at random."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from foretwin.contracts.arrays import Array
from foretwin.sim_worker.metrics import compiled_pairs, encroachment, following
from foretwin.sim_worker.metrics.rollout import Rollout, RolloutView
from tests.sim_worker.metrics.motions import VEHICLE, times

FUTURES, USERS = 3, 4
seeds = st.integers(0, 2**32 - 1)
drawn = settings(deadline=None, max_examples=30)


def scene(seed: int, *, bends: bool = True) -> RolloutView:
    """Everybody at every angle within 40 m, half in bends; somebody comes, and somebody goes."""
    random, time_s = np.random.default_rng(seed), times(4.0)

    def motions(*shape: int) -> tuple[Array, ...]:
        speed = random.uniform(-2.0, 12.0, (*shape, 1))
        rate = random.uniform(-0.8, 0.8, (*shape, 1)) * random.integers(0, 2, (*shape, 1)) * bends
        yaw = random.uniform(-3.0, 3.0, (*shape, 1)) + rate * time_s
        xy = random.uniform(-20.0, 20.0, (2, *shape, 1))
        step = np.diff(time_s, prepend=0.0) * speed
        x, y = np.cumsum(step * np.cos(yaw), axis=-1), np.cumsum(step * np.sin(yaw), axis=-1)
        return xy[0] + x, xy[1] + y, yaw, speed + 0.0 * yaw, rate + 0.0 * yaw

    x, y, yaw, speed, rate = motions(FUTURES)
    nothing = np.zeros_like(x)
    users = np.stack(motions(FUTURES, USERS), axis=-1).transpose(0, 2, 1, 3)
    users[:, : len(time_s) // 2, 0, :3] = users[:, len(time_s) // 2 :, 1, :3] = np.nan
    return RolloutView(
        Rollout(
            time_s=time_s,
            states=np.stack([x, y, yaw, speed, nothing, rate, nothing, nothing], axis=-1),
            users=users[..., :3],
            user_speed_mps=users[..., 3],
            user_size_m=random.uniform(0.4, 9.0, (FUTURES, USERS, 2)),
            valid=np.ones(FUTURES, dtype=bool),
            vehicle=VEHICLE,
        )
    )


@drawn
@given(seeds)
def test_leaders_are_those_within_reach_of_the_circle(seed: int) -> None:
    """Polar coordinates about the circle's centre, or straight ahead, instead of the formulas.

    Who backs is looked at from behind: its axes are turned round.
    """
    driven = scene(seed)
    way = np.where(driven.states[..., 3:4] < -0.05, -1.0, 1.0)
    seen, (half_length, half_width) = driven.relative, driven.user_half_m
    found = following.leaders(driven)
    speed, rate = driven.states[..., 3:4], driven.states[..., 5:6]
    bends = (np.abs(speed) > 1.0) & (rate != 0.0)
    radius = np.where(bends, np.abs(speed) / np.where(bends, rate, 1.0), 1.0)
    radius = np.copysign(np.maximum(np.abs(radius), 4.0), radius)
    x, y = way * (seen.ahead_m + driven.centre_ahead_m), way * seen.left_m
    side = np.sign(radius)
    left = np.where(bends, side * (np.abs(radius) - np.hypot(x, y - radius)), y)
    turn = np.where(bends, np.arctan2(x, side * (radius - y)), 0.0)
    along = np.where(bends, np.abs(radius) * turn, x)
    angle = np.arctan2(way * seen.sin, way * seen.cos) - side * turn
    lengthways = half_length * np.abs(np.cos(angle)) + half_width * np.abs(np.sin(angle))
    across = half_length * np.abs(np.sin(angle)) + half_width * np.abs(np.cos(angle))
    front = way * driven.centre_ahead_m + driven.half_length_m
    reach = driven.half_width_m + across
    ahead = (way * seen.ahead_m > 0.0) & (np.abs(turn) < np.pi / 2) & (along > front)
    ahead &= (np.abs(left) < reach) & ((np.cos(angle) >= 0.5) | (np.abs(seen.speed_mps) < 0.5))

    pair = np.flatnonzero(ahead)
    assert (found.row == pair // USERS).all()
    gap = np.maximum(along - front - lengthways, 0.0).reshape(-1)[pair]
    np.testing.assert_allclose(found.gap_m, gap, atol=1e-9)
    np.testing.assert_allclose(found.left_m, left.reshape(-1)[pair], atol=1e-9)
    np.testing.assert_allclose(found.reach_m, reach.reshape(-1)[pair], atol=1e-9)


@drawn
@given(seeds)
def test_a_stay_on_a_strip_lasts_while_a_corner_is_on_it(seed: int) -> None:
    driven = scene(seed)
    met = encroachment.crossings(driven)
    x, y, yaw, _ = driven.users
    length, width = (half[met.future, 0, met.user] for half in driven.user_half_m)
    strip_half = np.full(len(met.user), driven.half_width_m)
    stay = np.empty((2, len(met.user)))

    compiled_pairs.stays_on_strips(
        (x, y, yaw),
        (length, width),
        (met.future, met.user, met.user_step),
        driven.there,
        np.full(FUTURES, len(driven.time_s) - 1),
        met.point_m,
        met.ego_way,
        strip_half,
        driven.time_s,
        stay,
    )

    normal = np.stack([-met.ego_way[:, 1:], met.ego_way[:, :1]])
    track_x, track_y, angle = (values[met.future, :, met.user] for values in (x, y, yaw))
    off_x, off_y = track_x - met.point_m[:, :1], track_y - met.point_m[:, 1:]
    off = np.abs(off_x * normal[0] + off_y * normal[1]) - driven.half_width_m
    cos, sin = np.cos(angle), np.sin(angle)
    off -= length[:, None] * np.abs(cos * normal[0] + sin * normal[1])
    off -= width[:, None] * np.abs(cos * normal[1] - sin * normal[0])
    instants = driven.time_s
    for k, (came, left) in enumerate(stay.T):
        step, seen = met.user_step[k], driven.there[met.future[k], :, met.user[k]]
        # Whose track begins or ends on the strip came or left at a time that nobody knows.
        if np.isnan(came):
            assert off[k, seen.argmax()] < 0.0
            assert not seen[0]
        if np.isnan(left):
            assert off[k, len(seen) - 1 - seen[::-1].argmax()] < 0.0
            assert not seen[-1]
        if np.isnan(came) or np.isnan(left):
            continue
        assert came <= instants[step + 1]
        assert left >= instants[step]
        within = (instants > came) & (instants < left)
        assert (off[k, within] < 0.0).all()
        before, after = np.flatnonzero(instants <= came), np.flatnonzero(instants >= left)
        assert came == 0.0 or off[k, before[-1]] >= 0.0
        assert left == np.inf or off[k, after[0]] >= 0.0
