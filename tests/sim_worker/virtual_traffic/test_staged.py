"""A scenario as going traffic: timed to the car that comes, whatever its speed does."""

from __future__ import annotations

import numpy as np
import pytest
from msgspec.structs import replace

from foretwin.contracts.errors import UserError
from foretwin.sim_worker.scenarios.reading import find_scenario
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.sim_worker.virtual_traffic.source import STEP_S
from foretwin.sim_worker.virtual_traffic.staged import ScenarioTraffic, check_going
from tests.sim_worker.places import crossroads, straight_path
from tests.sim_worker.virtual_traffic.motions import G_MPS2, Scene, tracks


def met(speed_mps: float, *, late_s: float = 0.0) -> tuple[list[Scene], float]:
    """A car drives east through the crossing; returns the scenes and the least distance."""
    scenario = find_scenario("scp")
    actor = replace(scenario.actors[0], arrives_after_s=late_s)
    traffic = ScenarioTraffic(load_vehicle(), replace(scenario, actors=(actor,)), seed=1)
    traffic.use_world(crossroads())
    traffic.use_path(straight_path(from_x=-140.0, to_x=140.0).xy_m)
    scenes, least_m = [], np.inf
    for k in range(round(200.0 / speed_mps / STEP_S)):
        car = np.zeros(8)
        car[:4] = -120.0 + speed_mps * k * STEP_S, -1.5, 0.0, speed_mps
        scenes.append(traffic.step(car, time_s=k * STEP_S, colours={}))
        for user in scenes[-1]:
            least_m = min(least_m, float(np.hypot(user.x_m - car[0] - 1.4, user.y_m - car[1])))
    return scenes, least_m


@pytest.mark.parametrize("speed_mps", [6.0, 10.0, 13.0])
def test_who_crosses_meets_the_car_at_its_speed(speed_mps: float) -> None:
    scenes, least_m = met(speed_mps)
    assert least_m < 4.5
    for track in tracks(scenes).values():
        assert track.worst_jump_m() < 0.03
        assert track.worst_mps2() < 0.8 * G_MPS2


def test_who_is_meant_to_come_late_comes_behind_the_car() -> None:
    scenes, least_m = met(10.0, late_s=2.0)
    assert 6.0 < least_m < 16.0
    assert any(scenes)


def test_the_same_motion_gives_the_same_bits() -> None:
    assert met(10.0)[0] == met(10.0)[0]


@pytest.mark.parametrize("name", ["lead_stopping", "overtaking_motorway"])
def test_who_goes_along_with_the_car_is_refused(name: str) -> None:
    with pytest.raises(UserError, match="of the car; played as going traffic"):
        check_going(find_scenario(name))
