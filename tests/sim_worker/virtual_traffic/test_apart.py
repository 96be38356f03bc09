"""Nobody of going traffic drives into anybody: who would otherwise brakes in time."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from foretwin.contracts.arrays import Array
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.geometry.rectangles import Rectangles, overlapping
from foretwin.sim_worker.road_users.cast import Player, casting
from foretwin.sim_worker.road_users.crowd import EgoBoxes
from foretwin.sim_worker.road_users.path_table import PathTable
from foretwin.sim_worker.road_users.right_of_way import JunctionRules
from foretwin.sim_worker.road_users.traffic import Traffic
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.sim_worker.virtual_traffic.apart import who_must_brake
from foretwin.sim_worker.virtual_traffic.model import ModelTraffic
from foretwin.sim_worker.virtual_traffic.source import STEP_S, VirtualUser
from tests.sim_worker.places import crossroads
from tests.sim_worker.virtual_traffic.motions import played, still

EAST = np.array([[-100.0, 0.0], [100.0, 0.0]])
NORTH = np.array([[0.0, -100.0], [0.0, 100.0]])
GRIP_MPS2 = 7.0
FAR_AWAY = EgoBoxes(np.array([[0.0, 500.0, 0.0]]), np.zeros(1), 0, np.zeros(1), 4.5, 1.8)


def traffic_of(*cars: tuple[Array, float, float]) -> Traffic:
    """Cars on lines, each so far along it and so fast."""
    players = [
        Player(
            name=f"{k}", kind="car", path=FrenetPath(line), start_arc_m=arc_m, speed_mps=speed,
            desired_mps=speed, conduct="law_abiding", size_m=(4.5, 1.8),
        )
        for k, (line, arc_m, speed) in enumerate(cars)
    ]  # fmt: skip
    arrays = casting([players], ego_path=FrenetPath(np.add(EAST, [0.0, 500.0])), keys=[0])
    rules = JunctionRules(None).between([()] * (len(cars) + 1))
    return Traffic(arrays.crowd, PathTable(arrays.paths), rules, arrays.paces)


def must_brake(traffic: Traffic, car: EgoBoxes = FAR_AWAY) -> list[bool]:
    grip = np.full(traffic.arc_m.shape[1], GRIP_MPS2)
    return who_must_brake(traffic, car, grip).tolist()


@pytest.mark.parametrize(("gap_m", "brakes"), [(1.0, True), (8.0, True), (9.5, False)])
def test_who_comes_up_to_one_that_stands_brakes_as_late_as_it_can(
    gap_m: float, brakes: bool
) -> None:
    """From 10 m/s 0.85 of 7 m/s² need 8.4 m, and a step half a metre."""
    cars = (EAST, 100.0 - 4.5 - gap_m, 10.0), (EAST, 100.0, 0.0)
    assert must_brake(traffic_of(*cars)) == [brakes, False]


def test_whoever_is_ahead_does_not_brake_for_one_that_is_too_close_behind() -> None:
    cars = (EAST, 90.0, 12.0), (EAST, 95.2, 10.0)
    assert must_brake(traffic_of(*cars)) == [True, False]


def test_of_two_that_would_meet_at_a_crossing_one_brakes() -> None:
    cars = (EAST, 91.0, 8.0), (NORTH, 92.0, 8.0)
    assert sum(must_brake(traffic_of(*cars))) == 1
    later = (EAST, 91.0, 8.0), (NORTH, 60.0, 8.0)
    assert must_brake(traffic_of(*later)) == [False, False]


def test_oncoming_cars_pass_each_other() -> None:
    cars = (EAST, 90.0, 14.0), (np.add(EAST[::-1], [0.0, 2.2]), 90.0, 14.0)
    assert must_brake(traffic_of(*cars)) == [False, False]


def test_who_touches_already_may_drive_on() -> None:
    cars = (EAST, 96.0, 2.0), (EAST, 100.0, 2.0)
    assert must_brake(traffic_of(*cars)) == [False, False]


@pytest.mark.parametrize(("ahead_m", "brakes"), [(7.0, True), (20.0, False), (-7.0, False)])
def test_for_the_car_who_is_behind_it_brakes_and_who_is_before_it_not(
    ahead_m: float, brakes: bool
) -> None:
    poses = np.array([[ahead_m, 0.0, 0.0]])
    car = EgoBoxes(poses, np.array([0.0 if ahead_m > 0.0 else 20.0]), 0, np.zeros(1), 4.5, 1.8)
    assert must_brake(traffic_of((EAST, 100.0, 8.0)), car) == [brakes]


def touching(scene: tuple[VirtualUser, ...]) -> set[tuple[str, str]]:
    boxes = {
        one.user_id: Rectangles(
            np.array([one.x_m, one.y_m]), np.array(one.yaw_rad), one.length_m, one.width_m
        )
        for one in scene
    }
    return {(a, b) for a, b in itertools.combinations(boxes, 2) if overlapping(boxes[a], boxes[b])}


@pytest.mark.parametrize("seed", [0, 2])
def test_nobody_drives_into_anybody_in_half_a_minute(seed: int) -> None:
    """At a crossing without lights or signs, where nobody has to wait for anybody."""
    traffic = ModelTraffic(load_vehicle(), count=16, seed=seed)
    traffic.use_world(crossroads())
    scenes = list(played(traffic, still(20.0, 20.0), from_s=0.0, to_s=30.0))
    met = {pair for scene in scenes[::2] for pair in touching(scene)}
    assert met == set()
    assert sum(one.speed_mps for scene in scenes for one in scene) * STEP_S > 16 * 30.0


def test_who_has_room_to_get_past_one_that_stands_does_not_brake_for_the_room_beside_it() -> None:
    """0.15 m of room beside it, and half a metre until their boxes are alongside."""
    creeps = (EAST, 100.0 - 4.5 - 0.505, 0.2)
    assert must_brake(traffic_of(creeps, (np.add(EAST, [0.0, 1.95]), 100.0, 0.0))) == [False, False]
