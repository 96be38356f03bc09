"""Who has to give way: crossing streets, roundabouts, queues beyond, and those who walk."""

from __future__ import annotations

import math

import numpy as np
import pytest

from foretwin.contracts.arrays import Array
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.sim_worker.planner_interface import SeenUsers, SharedGround
from foretwin.sim_worker.planners.gap_acceptance import GapAcceptance
from foretwin.sim_worker.planners.giving_way import CRITICAL_GAP_S, ground_lines, wait_arcs
from foretwin.sim_worker.planners.pure_pursuit_idm import PurePursuitIdm
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from tests.sim_worker.planners.driven import (
    Drive,
    Other,
    at_rest_on,
    drive,
    straight,
    view_of,
    walker,
)

COVERS = ("foretwin.sim_worker.planners.giving_way",)

VEHICLE = load_vehicle()
MEETS_M = 50.0
SOUTHBOUND = np.array([[MEETS_M, 300.0], [MEETS_M, -300.0]])


def ground(*, waits: bool = True, their_yaw: float | None = -math.pi / 2) -> SharedGround:
    """A lane of 3.5 m that crosses a straight path 50 m ahead."""
    return SharedGround(
        np.array([MEETS_M - 1.75]), np.array([MEETS_M + 1.75]), np.array([[MEETS_M, 0.0]]),
        np.array([waits]), None if their_yaw is None else np.array([their_yaw]),
    )  # fmt: skip


def cross(*others: Other, planner: object = None, waits: bool = True, speed: float = 8.0,
          seconds: float = 14.0, yaw: float | None = -math.pi / 2) -> Drive:  # fmt: skip
    return cross_each(
        [list(others)], planner=planner, waits=waits, speed=speed, seconds=seconds, yaw=yaw
    )


def cross_each(others_of: list[list[Other]], *, planner: object = None, waits: bool = True,
               speed: float = 8.0, seconds: float = 14.0,
               yaw: float | None = -math.pi / 2) -> Drive:  # fmt: skip
    """As many cars as lists, each among its own others."""
    path, count = straight(), len(others_of)
    shared = ground(waits=waits, their_yaw=yaw)
    return drive(
        GapAcceptance() if planner is None else planner,  # type: ignore[arg-type]
        path, at_rest_on(path, 0.0, speed, count), vehicle=VEHICLE, seconds=seconds,
        others_of=others_of if any(others_of) else None, ground=shared,
    )  # fmt: skip


@pytest.mark.parametrize(("bend_accel_mps2", "waits"), [(1.0, True), (4.0, False)])
def test_who_is_slow_in_bends_needs_longer_to_cross(bend_accel_mps2: float, waits: bool) -> None:
    turned = np.linspace(0.0, math.pi, 60)
    bend = 15.0 * np.stack([np.sin(turned), 1.0 - np.cos(turned)], axis=-1)
    path = FrenetPath(np.concatenate([[[-30.0, 0.0]], bend]))
    (x, y), yaw = path.point_at(np.array([45.0]))[0], -math.pi / 2
    other = SeenUsers(
        np.array([[[x, y + 52.0, yaw]]]), np.array([[10.0]]), np.array([[[4.5, 1.8]]]),
        np.array([[45.0]]), np.array([[50.0]]), np.array([[False]]), np.array([[yaw]]),
    )  # fmt: skip
    crossed = SharedGround(
        np.array([43.0]), np.array([47.0]), np.array([[x, y]]), np.array([True]), None
    )
    starts = at_rest_on(path, 29.0, 4.0, 1)
    seen = {"users": other, "ground": crossed, "bend_accel_mps2": bend_accel_mps2}
    view = view_of(path, starts, VEHICLE, target_mps=12.0, **seen)
    assert np.isfinite(wait_arcs(view)).all() == waits


def arrives(after_s: float, speed: float = 10.0) -> Other:
    """Somebody whose centre is where the paths meet after so many seconds."""
    return Other(SOUTHBOUND, speed, 300.0 - speed * after_s)


@pytest.mark.parametrize("yaw", [-math.pi / 2, None])
def test_a_crossing_car_with_priority_is_let_past(yaw: float | None) -> None:
    careful = cross_each([[arrives(after_s)] for after_s in (4.0, 5.0, 6.0, 7.0, 8.0)], yaw=yaw)
    assert careful.clearance_m.min() > 0.8
    assert (careful.front_m[:, -1] > MEETS_M + 5.0).all()


def test_the_same_car_hits_a_planner_that_gives_way_to_nobody() -> None:
    assert cross(arrives(6.0), planner=PurePursuitIdm()).clearance_m.min() == 0.0


def test_who_has_priority_does_not_wait() -> None:
    alone = cross()
    first = cross(arrives(7.0), waits=False)
    assert first.states[0, :100] == pytest.approx(alone.states[0, :100], abs=1e-9)


def test_it_waits_with_its_front_before_the_ground_and_takes_the_first_gap_that_is_enough() -> None:
    gaps_s = [5.0, 8.0, 11.0, 14.0, 21.0]
    waits = cross(*(arrives(t) for t in gaps_s), seconds=24.0)
    line = MEETS_M - 1.75
    standing = np.abs(waits.states[0, :, 3]) < 0.1
    assert standing.any()
    assert np.all(line - 2.0 < waits.front_m[0, standing])
    assert np.all(waits.front_m[0, standing] < line)
    assert 14.0 < waits.first_s(line) < 21.0 - CRITICAL_GAP_S + 2.0
    assert waits.clearance_m.min() > 0.8


def test_a_long_gap_is_used_without_stopping() -> None:
    passes = cross(arrives(16.0), seconds=10.0)
    assert passes.states[0, :, 3].min() > 7.0


def test_somebody_who_drives_away_or_behind_is_no_reason_to_wait() -> None:
    northbound_beyond = Other(SOUTHBOUND[::-1], 10.0, 305.0)
    follower = Other(np.array([[-100.0, 0.0], [200.0, 0.0]]), 7.0, 85.0)
    assert cross(northbound_beyond, follower, seconds=8.0).states[0, :, 3].min() > 7.0


def test_ground_without_room_between_is_entered_as_one() -> None:
    pieces = SharedGround(
        np.array([20.0, 23.0, 40.0]), np.array([22.0, 26.0, 43.0]), np.zeros((3, 2)),
        np.array([False, True, True]),
    )  # fmt: skip
    stop, clear = ground_lines(pieces, length_m=4.5)
    assert stop.tolist() == [20.0, 20.0, 40.0]
    assert clear.tolist() == [26.0, 26.0, 43.0]


def test_ground_is_not_entered_while_a_queue_stands_beyond_it() -> None:
    tail = Other(np.array([[0.0, 0.0], [200.0, 0.0]]), 0.0, MEETS_M + 6.0)
    blocked = cross(tail, waits=False)
    assert MEETS_M - 5.0 < blocked.front_m[0, -1] < MEETS_M - 1.75
    farther = cross(tail._replace(from_m=MEETS_M + 14.0), waits=False)
    assert farther.front_m[0, -1] > MEETS_M + 5.0


def ring(radius_m: float, from_rad: float, to_rad: float) -> Array:
    angle = np.linspace(from_rad, to_rad, 60)
    return np.column_stack([radius_m * np.cos(angle), radius_m * np.sin(angle)])


@pytest.mark.parametrize("before_m", [10.0, 20.0, 30.0])
def test_at_a_roundabout_who_circulates_goes_first(before_m: float) -> None:
    radius = 14.0
    # Right-hand traffic goes round counter-clockwise; the ego enters from the south.
    enter = -math.pi / 2
    approach = np.column_stack([np.full(40, -4.0), np.linspace(-55.0, -radius - 3.0, 40)])
    circle = ring(radius, enter + 0.15, enter + math.pi)
    path = FrenetPath(np.concatenate([approach, circle]))
    meet = path.locate(circle[:1]).arc_m[0]
    shared = SharedGround(
        np.array([meet - 3.0]), np.array([meet + 2.0]), circle[:1], np.array([True]), np.zeros(1)
    )
    around = ring(radius, enter - 4.0, enter + 4.0)
    arc_at_entry = radius * 4.15
    # It passes the entry as the ego, alone, would enter.
    other = Other(around, 6.0, arc_at_entry - 6.0 * 5.0 - before_m + 20.0)
    done = drive(
        GapAcceptance(), path, at_rest_on(path, 8.0, 7.0), vehicle=VEHICLE, seconds=14.0,
        others=[other], ground=shared, target_mps=7.0,
    )  # fmt: skip
    assert done.clearance_m.min() > 0.5
    assert done.arc_m[0, -1] > meet + 5.0


@pytest.mark.parametrize("speed", [1.4, 3.0])
def test_those_who_walk_over_the_path_are_let_past(speed: float) -> None:
    line = np.array([[MEETS_M, -40.0], [MEETS_M, 40.0]])
    walkers = [
        walker(line, speed, 40.0 - speed * (starts_s + 1.0))
        for starts_s in (2.0, 3.0, 4.0, 5.0, 6.0)
    ]
    done = cross_each([[one] for one in walkers], waits=False, seconds=16.0)
    assert done.clearance_m.min() > 0.4
    assert (done.front_m[:, -1] > MEETS_M + 4.0).all()


def test_who_walks_beside_the_road_is_passed() -> None:
    line = np.array([[0.0, 3.2], [200.0, 3.2]])
    assert cross(walker(line, 1.4, 20.0), seconds=6.0).states[0, :, 3].min() > 7.0
