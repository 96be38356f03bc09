"""The lattice planner: keeps its speed, follows, stops, evades within its lane, and gives way."""

from __future__ import annotations

import math

import numpy as np
import pytest

from foretwin.geometry.frenet_path import FrenetPath
from foretwin.sim_worker.planner_interface import SharedGround
from foretwin.sim_worker.planners.constant_speed import ConstantSpeed
from foretwin.sim_worker.planners.frenet_lattice import FrenetLattice
from foretwin.sim_worker.planners.lattice_choice import choose
from foretwin.sim_worker.planners.pure_pursuit_idm import PurePursuitIdm
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from tests.sim_worker.planners.driven import (
    Other,
    at_rest_on,
    drive,
    see,
    straight,
    view_of,
    walker,
)

COVERS = (
    "foretwin.sim_worker.planners.lattice_choice",
    "foretwin.sim_worker.planners.lattice_rating",
)

VEHICLE = load_vehicle()
ALONG = np.array([[0.0, 0.0], [300.0, 0.0]])


def bend(radius_m: float) -> FrenetPath:
    angle = np.linspace(0.0, math.pi / 2, 40)
    turn = radius_m * np.column_stack([np.sin(angle), 1.0 - np.cos(angle)])
    ends = [np.array([[-40.0, 0.0]]), turn, turn[-1:] + np.array([0.0, 60.0])]
    return FrenetPath(np.concatenate(ends))


def test_it_reaches_its_speed_and_keeps_the_middle_of_its_lane() -> None:
    path = straight()
    starts = at_rest_on(path, 0.0, 2.0, count=2)
    starts[1, 1] = 0.8
    done = drive(FrenetLattice(), path, starts, vehicle=VEHICLE, seconds=12.0, target_mps=9.0)
    assert done.states[:, -1, 3] == pytest.approx(9.0, abs=0.4)
    assert np.abs(done.offset_m[:, -1]).max() < 0.1
    assert np.abs(done.states[:, :, 7]).max() < 4.0


@pytest.mark.parametrize("radius_m", [12.0, 30.0])
def test_it_slows_down_for_a_bend_and_stays_on_its_path(radius_m: float) -> None:
    path = bend(radius_m)
    done = drive(
        FrenetLattice(), path, at_rest_on(path, 0.0, 9.0), vehicle=VEHICLE, seconds=10.0,
        target_mps=10.0,
    )  # fmt: skip
    lateral = np.abs(done.states[0, :, 3] * done.states[0, :, 5])
    assert lateral.max() < 4.5
    assert np.abs(done.offset_m).max() < 0.7
    assert done.arc_m[0, -1] > 45.0 + radius_m


def test_it_follows_a_slower_car_and_stops_behind_a_standing_one() -> None:
    path = straight(300.0)
    speeds = np.array([0.0, 3.0, 6.0])
    done = drive(
        FrenetLattice(), path, at_rest_on(path, 0.0, 10.0, 3), vehicle=VEHICLE, seconds=16.0,
        others_of=[[Other(ALONG, speed, 45.0)] for speed in speeds], target_mps=10.0,
    )  # fmt: skip
    assert done.clearance_m.min() > 0.7
    assert done.states[:, -1, 3] == pytest.approx(speeds, abs=0.8)
    gaps = 45.0 + 16.0 * speeds - 2.25 - done.front_m[:, -1]
    assert (gaps > 0.7).all()
    assert (gaps < 5.0 + 2.0 * speeds).all()


def test_it_stops_at_a_red_light_and_goes_on() -> None:
    path = straight()
    done = drive(
        FrenetLattice(), path, at_rest_on(path, 0.0, 10.0), vehicle=VEHICLE, seconds=20.0,
        target_mps=10.0, red_arc_m=60.0, red_until_s=14.0,
    )  # fmt: skip
    waiting = done.front_m[0, round(13.9 / 0.05)]
    assert 56.0 < waiting < 60.0
    assert done.front_m[0, -1] > 65.0


def test_it_evades_what_reaches_a_little_into_its_lane() -> None:
    path = straight()
    parked = Other(ALONG + np.array([0.0, -1.9]), 0.0, 40.0)
    done = drive(
        FrenetLattice(), path, at_rest_on(path, 0.0, 8.0), vehicle=VEHICLE, seconds=9.0,
        others=[parked],
    )  # fmt: skip
    assert done.clearance_m.min() > 0.2
    assert done.front_m[0, -1] > 55.0
    assert done.offset_m.max() > 0.2
    plain = drive(
        PurePursuitIdm(), path, at_rest_on(path, 0.0, 8.0), vehicle=VEHICLE, seconds=9.0,
        others=[parked],
    )  # fmt: skip
    assert plain.front_m[0, -1] < 40.0


def test_nobody_who_crosses_is_hit() -> None:
    path = straight()
    line = np.array([[45.0, -150.0], [45.0, 150.0]])
    after_s = (3.0, 4.0, 5.0, 6.0)
    crossing = [walker(line, 1.5, 150.0 - 1.5 * at_s) for at_s in after_s]
    crossing += [Other(line, 8.0, 150.0 - 8.0 * at_s) for at_s in after_s]
    done = drive(
        FrenetLattice(), path, at_rest_on(path, 0.0, 8.0, len(crossing)), vehicle=VEHICLE,
        seconds=14.0, others_of=[[one] for one in crossing],
    )  # fmt: skip
    assert done.clearance_m.min() > 0.2
    assert (done.front_m[:, -1] > 50.0).all()


@pytest.mark.parametrize("speed", [6.5, 9.0])
def test_it_brakes_for_who_turns_across_as_soon_as_that_begins(speed: float) -> None:
    path = straight()
    angle = np.linspace(0.0, math.pi / 2, 30)
    turn = np.array([45.0, 3.2]) + 8.0 * np.column_stack([-np.sin(angle), np.cos(angle) - 1.0])
    line = np.concatenate([[[145.0, 3.2]], turn, turn[-1:] - np.array([0.0, 60.0])])
    # Unhindered they meet: the ego in the junction's middle, the other one in its lane.
    other = Other(line, 6.0, 108.0 - 6.0 * 38.0 / speed)
    done = {
        planner: drive(
            planner(), path, at_rest_on(path, 0.0, speed), vehicle=VEHICLE, seconds=10.0,
            others=[other], target_mps=speed,
        )
        for planner in (ConstantSpeed, FrenetLattice)
    }  # fmt: skip
    assert done[ConstantSpeed].clearance_m.min() == 0.0
    assert done[FrenetLattice].clearance_m.min() > 0.2
    assert done[FrenetLattice].states[0, -1, 3] > 3.0


def test_it_gives_way_where_the_world_says_so() -> None:
    path = straight()
    ground = SharedGround(
        np.array([48.0]), np.array([52.0]), np.array([[50.0, 0.0]]), np.array([True]),
        np.array([-math.pi / 2]),
    )  # fmt: skip
    line = np.array([[50.0, 300.0], [50.0, -300.0]])
    crossing = [Other(line, 10.0, 300.0 - 10.0 * t) for t in (6.0, 8.5, 11.0)]
    done = drive(
        FrenetLattice(), path, at_rest_on(path, 0.0, 8.0), vehicle=VEHICLE, seconds=20.0,
        others=crossing, ground=ground,
    )  # fmt: skip
    assert done.clearance_m.min() > 0.8
    assert 9.5 < done.first_s(48.0) < 15.0


def test_what_one_car_does_is_independent_of_the_others_in_the_job() -> None:
    path = bend(25.0)
    starts = at_rest_on(path, 0.0, 7.0, count=6)
    starts[:, 3] += np.arange(6.0)
    others = [Other(ALONG - [[60.0, 3.0]], 6.0, 70.0), walker(ALONG[:, ::-1], 1.4)]
    view = view_of(path, starts, VEHICLE, target_mps=9.0, users=see(path, others, 0.0, 6)[0])
    along, across = choose(view)
    for rows in ([0], [3], [1, 4, 5]):
        seen = see(path, others, 0.0, len(rows))[0]
        alone = choose(view_of(path, starts[rows], VEHICLE, target_mps=9.0, users=seen))
        for whole, part in zip((along, across), alone, strict=True):
            assert whole.coefficients[:, rows].tobytes() == part.coefficients.tobytes()


def test_it_brakes_for_a_car_ahead_between_its_choices_once_that_brakes() -> None:
    path = straight(300.0)
    driver = FrenetLattice().begin(1)
    asked = []
    for time_s, lead_mps in ((0.0, 10.0), (0.28, 10.0), (0.3, 9.6)):
        users, _ = see(path, [Other(ALONG, lead_mps, 20.0)], 0.0, 1)
        view = view_of(
            path,
            at_rest_on(path, 0.0, 10.0, 1),
            VEHICLE,
            time_s=time_s,
            target_mps=10.0,
            users=users,
            lead_gap_m=np.array([14.0]),
            lead_speed_mps=np.array([lead_mps]),
        )
        asked.append(float(driver.plan(view).accel_mps2[0]))
    assert asked[2] < 0.0 < asked[1]
