from __future__ import annotations

import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from foretwin.contracts.arrays import Array
from foretwin.geometry.rectangles import Rectangles, clearance
from foretwin.sim_worker.batch.collision_detection import (
    Touches,
    ego_rectangles,
    first_touches,
    touched,
)
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.sim_worker.vehicle.reference_points import box_centre_from_base_m

CAR = load_vehicle()
TICK_S = 0.05
FRONT_M = box_centre_from_base_m(CAR) + CAR.length_m.value / 2.0


def straight(count: int, ticks: int, *, speed: float = 10.0) -> Array:
    """Futures that drive east from the origin, with the front bumper at x = 0 to begin with."""
    states = np.zeros((count, ticks, 8))
    states[:, :, 0] = speed * TICK_S * np.arange(ticks) - FRONT_M
    states[:, :, 3] = speed
    return states


def search(states: Array, users: Array, *, length: float = 4.0, width: float = 2.0) -> Touches:
    size = np.broadcast_to([length, width], (*users.shape[::2][:1], users.shape[2], 2))
    found = first_touches(CAR, states, users, size, tick_s=TICK_S)
    # Who only asks whether there is one is told the same.
    any_touch = touched(CAR, states, users, size, tick_s=TICK_S)
    assert np.flatnonzero(any_touch).tolist() == sorted(found.future)
    return found


def moving(x: float, y: float, yaw: float, vx: float, vy: float, *, ticks: int) -> Array:
    """One road user of one future, at an even speed: (1, T, 1, 3)."""
    time_s = TICK_S * np.arange(ticks)
    return np.stack([x + vx * time_s, y + vy * time_s, np.full(ticks, yaw)], -1)[None, :, None]


def test_a_parked_car_is_touched_when_the_bumpers_meet() -> None:
    touch = search(straight(1, 40), moving(8.13 + 2.0, 0.0, 0.0, 0.0, 0.0, ticks=40))
    assert touch.time_s == pytest.approx([0.813], abs=1e-4)
    assert touch.time_s[0] <= 0.813
    assert touch.point_m[0] == pytest.approx([8.13, 0.0], abs=1e-2)
    assert touch.normal[0] == pytest.approx([1.0, 0.0])
    assert touch.ego_states[0, 0] + FRONT_M == pytest.approx(8.13, abs=1e-3)
    assert not touch.from_start[0]


def test_a_crossing_pedestrian_is_touched_by_the_corner_that_reaches_it() -> None:
    half = CAR.width_m.value / 2.0
    walking = moving(5.0, -half - 0.25 - 0.75, np.pi / 2, 0.0, 1.5, ticks=40)
    touch = search(straight(1, 40), walking, length=0.5, width=0.5)
    # Its side is where the car passes from 0.475 s on, and it walks in after 0.5 s.
    assert touch.time_s == pytest.approx([0.5], abs=1e-4)
    assert touch.normal[0] == pytest.approx([0.0, -1.0], abs=1e-9)
    assert touch.user_velocities[0] == pytest.approx([0.0, 1.5, 0.0])
    assert touch.point_m[0] == pytest.approx([4.9, -half], abs=0.2)


def test_only_the_first_touch_of_each_future_counts() -> None:
    states = straight(3, 40)
    users = np.full((3, 40, 3, 3), np.nan)
    users[0, :, 0] = (14.0, 0.0, 0.0)
    users[0, :, 2] = (9.0, 0.0, 0.0)
    users[2, :, 1] = (9.0, 30.0, 0.0)
    touch = search(states, users)
    assert touch.future.tolist() == [0]
    assert touch.user.tolist() == [2]
    assert touch.time_s == pytest.approx([0.7], abs=1e-4)


def test_who_is_inside_the_car_at_first_has_no_impact() -> None:
    states = straight(2, 10)
    users = np.full((2, 10, 1, 3), np.nan)
    users[0, :, 0] = (-1.0, 0.0, 0.0)
    users[1, 6:, 0] = (0.5 * 6 - 1.0, 0.0, 0.0)
    touch = search(states, users)
    assert touch.from_start.all()
    assert touch.time_s == pytest.approx([0.0, 0.3])


def test_a_touch_between_two_ticks_is_found() -> None:
    # Within one tick of 50 ms, it passes through the corner of the car and out again.
    states = straight(1, 3, speed=0.0)
    passing = moving(0.05, 0.9 - 2.0 * 50.0 / 40, 0.0, 0.0, 50.0, ticks=3)
    touch = search(states, passing, length=0.2, width=0.05)
    edge = -CAR.width_m.value / 2.0 - 0.025
    assert touch.time_s == pytest.approx([(edge - (0.9 - 2.5)) / 50.0], abs=1e-4)


@pytest.mark.parametrize("closing_mps", [58.0, 70.0, 80.0, 99.0])
def test_a_fast_head_on_touch_is_an_impact_wherever_in_a_tick_it_falls(closing_mps: float) -> None:
    """Two cars that come from 40 m apart are not in each other from the start."""
    ticks, speed = 30, closing_mps / 2.0
    for share in np.arange(0.05, 1.0, 0.1):
        gap_m = 40.0 + share * closing_mps * TICK_S
        oncoming = moving(gap_m + 2.0, 0.0, np.pi, -speed, 0.0, ticks=ticks)
        touch = search(straight(1, ticks, speed=speed), oncoming)
        assert not touch.from_start[0]
        assert touch.time_s == pytest.approx([gap_m / closing_mps], abs=1e-4)


@settings(max_examples=80, deadline=None)
@given(
    st.floats(0.0, 15.0), st.floats(-20.0, 20.0), st.floats(-20.0, 20.0), st.floats(-4.0, 4.0),
    st.floats(-15.0, 15.0), st.floats(-15.0, 15.0),
)  # fmt: skip
def test_the_first_touch_is_that_of_a_slow_search(
    speed: float, x: float, y: float, yaw: float, vx: float, vy: float
) -> None:
    ticks, fine = 41, 4001
    touch = search(straight(1, ticks, speed=speed), moving(x, y, yaw, vx, vy, ticks=ticks))
    time_s = np.linspace(0.0, (ticks - 1) * TICK_S, fine)
    states = np.zeros((fine, 8))
    states[:, 0] = speed * time_s - FRONT_M
    centre = np.stack([x + vx * time_s, y + vy * time_s], -1)
    gap = clearance(ego_rectangles(CAR, states), Rectangles(centre, np.full(fine, yaw), 4.0, 2.0))
    within = np.flatnonzero(gap <= 0.0)
    if not len(within):
        assert not len(touch.time_s)
    elif len(within) > 0.01 / time_s[1] or within[0] == 0:
        assert touch.time_s == pytest.approx([time_s[within[0]]], abs=time_s[1] + 1e-4)
        assert touch.from_start[0] == (within[0] == 0)


def test_twenty_distant_road_users_of_64_futures_cost_little() -> None:
    states = straight(64, 161)
    users = np.zeros((64, 161, 20, 3))
    users[..., 1] = 40.0 + 5.0 * np.arange(20)
    size = np.broadcast_to([4.5, 1.8], (64, 20, 2))
    best_s, yardstick_s = np.inf, np.inf
    for _ in range(30):
        start = time.process_time()
        first_touches(CAR, states, users, size, tick_s=TICK_S)
        middle = time.process_time()
        np.hypot(users[..., 0], users[..., 1])
        best_s = min(best_s, middle - start)
        yardstick_s = min(yardstick_s, time.process_time() - middle)
    print(f"{best_s / yardstick_s:.2f} times one distance of each")
    assert best_s < 4.0 * yardstick_s
