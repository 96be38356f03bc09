"""SUMO as virtual traffic: what is wrong is said; its vehicles, where SUMO is there, go on."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from foretwin.contracts.drive import SignalColour
from foretwin.contracts.errors import UserError
from foretwin.geometry.rectangles import Rectangles, clearance
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.sim_worker.vehicle.reference_points import box_centre_from_base_m
from foretwin.sim_worker.virtual_traffic.source import STEP_S
from foretwin.sim_worker.virtual_traffic.sumo import SumoTraffic, check_network, is_there, net_of
from foretwin.sim_worker.virtual_traffic.sumo_lights import groups_of_signals
from foretwin.world_gen.export.opendrive import write_opendrive
from tests.orchestrator.trip import town_world
from tests.sim_worker.scenarios.worlds import cross
from tests.sim_worker.virtual_traffic.motions import G_MPS2, played, still, tracks
from tests.world_gen.drawn_maps import IRELAND, crossing, world_of

CAR = load_vehicle()


def test_a_network_of_sumo_is_taken_as_it_is(tmp_path: Path) -> None:
    net = tmp_path / "a.net.xml"
    assert net_of(net, tmp_path) == net


def test_left_hand_traffic_is_taken_in_the_version_that_netconvert_reads(tmp_path: Path) -> None:
    network = tmp_path / "a.xodr"
    write_opendrive(world_of(crossing(origin=IRELAND)), network)
    with pytest.raises(UserError, match=r"a\.xodr: .* left-hand .*--opendrive-version 1\.4"):
        check_network(network)
    write_opendrive(world_of(crossing(origin=IRELAND)), network, version="1.4")
    check_network(network)


@pytest.mark.skipif(is_there(), reason="SUMO is there")
def test_without_sumo_one_line_says_what_to_install(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"pip install 'foretwin\[sumo\]'"):
        SumoTraffic(load_vehicle(), tmp_path / "a.net.xml", count=3, seed=1)


@pytest.mark.skipif(not is_there(), reason="needs the extra sumo")
def test_vehicles_drive_on_the_network_of_our_own_export(tmp_path: Path) -> None:
    write_opendrive(cross(), tmp_path / "a.xodr")
    traffic = SumoTraffic(load_vehicle(), net_of(tmp_path / "a.xodr", tmp_path), count=4, seed=1)
    try:
        scenes = list(played(traffic, still(20.0, 20.0), from_s=0.0, to_s=20.0))
    finally:
        traffic.close()
    assert scenes[100]
    for track in tracks(scenes).values():
        along = np.abs(np.diff(track.rows[:, 3])) / 0.05
        assert along.max(initial=0.0) <= 7.6


@pytest.mark.skipif(not is_there(), reason="needs the extra sumo")
def test_for_whom_there_was_no_room_comes_out_of_sight_later(tmp_path: Path) -> None:
    """More than the roads have room for at once, and a car that drives on meanwhile."""
    network = tmp_path / "a.xodr"
    write_opendrive(town_world("n11"), network)
    traffic = SumoTraffic(load_vehicle(), net_of(network, tmp_path), count=40, seed=0)

    def car(time_s: float) -> tuple[float, float, float, float]:
        return -100.0 + 8.0 * time_s, -1.5, 0.0, 8.0

    try:
        scenes = list(played(traffic, car, from_s=0.0, to_s=20.0))
    finally:
        traffic.close()
    known = {user.user_id for user in scenes[0]}
    came_m = []
    for k, scene in enumerate(scenes):
        x, y, *_ = car(k * 0.05)
        new = [user for user in scene if user.user_id not in known]
        came_m += [float(np.hypot(user.x_m - x, user.y_m - y)) for user in new]
        known |= {user.user_id for user in new}
    assert len(came_m) > 5
    assert min(came_m) > 95.0


@pytest.mark.skipif(not is_there(), reason="needs the extra sumo")
def test_who_is_close_to_a_light_brakes_in_the_step_in_which_it_turns_red(tmp_path: Path) -> None:
    network = tmp_path / "a.xodr"
    write_opendrive(town_world("n44"), network)
    net, group_of = net_of(network, tmp_path), groups_of_signals(network)

    def speeds(*, red_from: int, steps: int) -> list[dict[str, float]]:
        traffic = SumoTraffic(load_vehicle(), net, count=12, seed=3, group_of=group_of)
        row, found = np.zeros(8), []
        row[:2] = 300.0
        try:
            for step in range(steps):
                shown: SignalColour = "red" if step >= red_from else "green"
                colours = dict.fromkeys(group_of.values(), shown)
                users = traffic.step(row, time_s=step * STEP_S, colours=colours)
                found.append({one.user_id: one.speed_mps for one in users})
        finally:
            traffic.close()
        return found

    green, flipped = speeds(red_from=999, steps=161), speeds(red_from=160, steps=161)
    assert flipped[:160] == green[:160]
    assert any(flipped[160][name] < speed - 0.1 for name, speed in green[160].items())


def outline(x: float, y: float, yaw: float, length_m: float, width_m: float) -> Rectangles:
    return Rectangles(np.array([[x, y]]), np.array([yaw]), length_m, width_m)


@pytest.mark.skipif(not is_there(), reason="needs the extra sumo")
@pytest.mark.parametrize(
    ("x", "y", "yaw_deg"),
    [(-40.0, -1.5, 17.0), (-40.0, -3.0, 90.0), (-40.0, -3.9, 60.0), (-40.0, 1.5, 0.0)],
)
def test_they_stand_before_a_car_that_stands_in_their_way(
    tmp_path: Path, x: float, y: float, yaw_deg: float
) -> None:
    """Turned, across both lanes and on the wrong side; nobody appears on top of it either."""
    yaw = math.radians(yaw_deg)
    middle = np.array([x, y]) + box_centre_from_base_m(CAR) * np.array([np.cos(yaw), np.sin(yaw)])
    mine = outline(*middle, yaw, CAR.length_m.value, CAR.width_m.value)
    write_opendrive(cross(), tmp_path / "a.xodr")
    traffic = SumoTraffic(CAR, net_of(tmp_path / "a.xodr", tmp_path), count=10, seed=3)
    touched = stood = 0
    try:
        for scene in played(traffic, still(x, y, yaw), from_s=0.0, to_s=40.0):
            for one in scene:
                theirs = outline(one.x_m, one.y_m, one.yaw_rad, one.length_m, one.width_m)
                apart_m = float(clearance(mine, theirs)[0])
                touched += apart_m == 0.0
                stood += apart_m < 10.0 and one.speed_mps < 0.1
    finally:
        traffic.close()
    assert touched == 0
    assert stood > 20


def district(tmp_path: Path) -> SumoTraffic:
    write_opendrive(cross(), tmp_path / "a.xodr")
    net = net_of(tmp_path / "a.xodr", tmp_path)
    return SumoTraffic(load_vehicle(), net, count=6, seed=3)


@pytest.mark.skipif(not is_there(), reason="needs the extra sumo")
def test_the_same_seed_beside_the_same_car_is_the_same_traffic(tmp_path: Path) -> None:
    told = []
    for _ in range(2):
        traffic = district(tmp_path)
        car = lambda now_s: (-60.0 + 5.0 * now_s, -1.75, 0.0, 5.0)  # noqa: E731
        try:
            told.append(list(played(traffic, car, from_s=0.0, to_s=15.0)))
        finally:
            traffic.close()
    assert told[0] == told[1]
    found = tracks(told[0])
    assert found
    assert max(track.worst_mps2() for track in found.values()) < 0.8 * G_MPS2
