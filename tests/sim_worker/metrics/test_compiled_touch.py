"""When boxes on arcs touch: closed forms, and outlines followed in small steps."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from foretwin.contracts.arrays import Array
from foretwin.geometry.rectangles import Rectangles, clearance
from foretwin.sim_worker.metrics import compiled_touch
from foretwin.sim_worker.metrics.rollout import Rollout, RolloutView
from foretwin.sim_worker.metrics.time_to_collision import meeting, ttc_series
from tests.sim_worker.metrics.motions import LENGTH_M, WIDTH_M, Mover, rollout, times
from tests.sim_worker.metrics.test_compiled_pairs import scene

HALF_M = (LENGTH_M / 2, WIDTH_M / 2)
seeds = st.integers(0, 2**32 - 1)


def on_circle(
    radius_m: float, angle: Array, speed_mps: float, *others: tuple[Array, float]
) -> Rollout:
    """Everybody's middle on one circle to the left, `others` at (angles (N,), speed)."""
    time_s = times(0.1 * (len(angle) - 1))
    driven = rollout(Mover(0, 0), *(Mover(0, 0, 0, v, LENGTH_M, WIDTH_M) for _, v in others),
                     time_s=time_s)  # fmt: skip

    def poses(at: Array) -> Array:
        return np.column_stack([radius_m * np.sin(at), radius_m * (1 - np.cos(at)), at])

    back, rate = RolloutView(driven).centre_ahead_m, speed_mps / radius_m
    driven.states[0, :, :3] = poses(angle)
    driven.states[0, :, 0] -= back * np.cos(angle)
    driven.states[0, :, 1] -= back * np.sin(angle)
    # The middle keeps to the circle: the axle behind it slides outwards.
    driven.states[0, :, 3:6] = (speed_mps, -back * rate, rate)
    for k, (at, _) in enumerate(others):
        driven.users[0, :, k] = poses(at)
    return driven


@settings(max_examples=60)
@given(st.floats(12.0, 120.0), st.floats(5.0, 15.0), st.floats(0.2, 0.9), st.floats(0.5, 1.2))
def test_a_leader_in_the_same_bend_is_touched_with_the_inner_corners(
    radius_m: float, speed_mps: float, slower: float, ahead: float
) -> None:
    """Both turn about one centre: the angle between them falls by the difference of their rates."""
    other_mps, steps = slower * speed_mps, np.arange(3) * 0.1
    corners = 2.0 * math.atan(HALF_M[0] / (radius_m - HALF_M[1]))
    apart = max(ahead * 30.0 / radius_m, corners + 0.01)
    rate, other_rate = speed_mps / radius_m, other_mps / radius_m
    until = (apart - corners) / (rate - other_rate)
    assume(until < min(compiled_touch.TURNS_FOR_S, math.pi / rate) - 0.01)

    driven = on_circle(radius_m, rate * steps, speed_mps, (apart + other_rate * steps, other_mps))

    expected = until - steps
    found = ttc_series(RolloutView(driven)).values[0]
    assert found[expected > 0.0] == pytest.approx(expected[expected > 0.0], abs=1e-6)


def test_who_waits_straight_ahead_of_a_bend_is_not_in_the_way_and_who_waits_in_it_is() -> None:
    steps, radius_m, speed_mps = np.arange(2) * 0.1, 30.0, 9.0
    aside = on_circle(radius_m, speed_mps / radius_m * steps, speed_mps, (0.0 * steps + 1.0, 0.0))
    straight = aside._replace(users=aside.users.copy())
    straight.users[0, :, 0] = (32.0, 0.0, 0.0)

    assert ttc_series(RolloutView(straight)).values[0, 0] == math.inf
    assert ttc_series(RolloutView(aside)).values[0, 0] == pytest.approx(
        (1.0 - 2.0 * math.atan(HALF_M[0] / (radius_m - HALF_M[1]))) * radius_m / speed_mps, abs=1e-6
    )


def test_nobody_is_taken_to_turn_for_more_than_half_a_circle_or_eight_seconds() -> None:
    steps = np.arange(2) * 0.1
    tight = on_circle(8.0, 8.0 / 8.0 * steps, 8.0, (0.0 * steps + 3.9, 0.0))
    wide = on_circle(200.0, 10.0 / 200.0 * steps, 10.0, (0.0 * steps + 0.45, 0.0))

    assert ttc_series(RolloutView(tight)).values[0, 0] == math.inf
    assert ttc_series(RolloutView(wide)).values[0, 0] == math.inf
    wide.users[0, :, 0] = on_circle(200.0, 0.0 * steps + 0.4, 10.0).states[0, :, :3]
    assert 7.0 < ttc_series(RolloutView(wide)).values[0, 0] < 8.0


@settings(deadline=None, max_examples=30)
@given(seeds)
def test_straight_on_it_is_that_of_all_pairs_to_the_bit(seed: int) -> None:
    driven = scene(seed, bends=False)
    seen = driven.relative
    touch = meeting(seen[:6], driven.half_m, driven.user_half_m)
    until = np.maximum(touch.from_s, 0.0)
    until[touch.until_s < until] = np.inf
    assert (ttc_series(driven).values == until.min(axis=2)).all()


@settings(deadline=None, max_examples=200)
@given(seeds)
def test_outlines_on_arcs_come_to_touch_then_and_not_before(seed: int) -> None:
    """Poses by many small straight steps, which know no arcs; distances by corners and edges."""
    random = np.random.default_rng(seed)
    yaw, bearing = random.uniform(-math.pi, math.pi, 2)
    ahead, left = random.uniform(4.0, 30.0) * np.array([math.cos(bearing), math.sin(bearing)])
    speed, slide, other_mps = random.uniform([-2.0, -6.0, -3.0], [14.0, 6.0, 14.0])
    rate, other_rate = random.uniform(-0.8, 0.8, 2)
    half_m, other_half_m = tuple(random.uniform(0.4, 3.0, 2)), tuple(random.uniform(0.2, 6.0, 2))
    pair = ahead, left, math.cos(yaw), math.sin(yaw), speed, slide, rate, other_mps, other_rate

    until = compiled_touch.until_turning_touch(pair, half_m, other_half_m, 5.0)

    fine = np.linspace(0.0, 5.0, 20_001)
    middle, step = (fine[1:] + fine[:-1]) / 2.0, fine[1]

    def walked(x: float, y: float, at: float, turn: float, along: float, aside: float) -> Array:
        facing = at + turn * middle
        vx = along * np.cos(facing) - aside * np.sin(facing)
        vy = along * np.sin(facing) + aside * np.cos(facing)
        xy = np.stack([np.cumsum(vx), np.cumsum(vy)]) * step
        return np.column_stack([np.vstack([[x, y], xy.T + np.array([x, y])]), at + turn * fine])

    own, other = (
        walked(0, 0, 0, rate, speed, slide),
        walked(ahead, left, yaw, other_rate, other_mps, 0),
    )

    def apart(which: slice) -> Array:
        boxes = [
            Rectangles(poses[which, :2], poses[which, 2], 2.0 * half[0], 2.0 * half[1])
            for poses, half in ((own, half_m), (other, other_half_m))
        ]
        return np.asarray(clearance(*boxes))

    if until == 0.0:
        assert apart(slice(0, 1))[0] <= 1e-9
    elif math.isfinite(until):
        at = int(until / step)
        assert apart(slice(at, at + 2)).min() < 20.0 * step
        assert apart(slice(0, max(at - 8, 1), 8)).min() > 0.0
    else:
        # A corner that is grazed for less than a fiftieth of a second may be overlooked.
        touched = apart(slice(0, None, 8)) <= 0.0
        assert touched.sum() * 8 * step < 0.02
