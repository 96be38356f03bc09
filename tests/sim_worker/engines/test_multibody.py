from __future__ import annotations

import numpy as np
import pytest

from foretwin.contracts.futures import EngineName
from foretwin.sim_worker.batch.batch_simulation import BatchSimulation, Controls
from foretwin.sim_worker.futures.run_job import stage_for
from foretwin.sim_worker.vehicle.parameters import bundled_vehicles, load_vehicle, scale_of
from tests.sim_worker.driving import altered, drive, seed, states

COVERS = ("foretwin.sim_worker.engines.engine", "foretwin.sim_worker.engines.multibody_car")

CAR = load_vehicle()
SPEED, ANGLE = np.array([0.0, 5.0, 8.0, 12.0]), np.array([0.0, 0.2, 0.1, -0.05])


def stage(engine: EngineName, vehicle: str = "bmw_320i", nsim: int = 4) -> BatchSimulation:
    return stage_for(engine, None, load_vehicle(vehicle), nsim=nsim)


@pytest.mark.parametrize("vehicle", [one for one in bundled_vehicles() if scale_of(one) == 1.0])
def test_in_ordinary_driving_it_goes_where_the_twin_goes(vehicle: str) -> None:
    ends = []
    engines: tuple[EngineName, EngineName] = ("mujoco", "multibody")
    for engine in engines:
        place = stage(engine, vehicle)
        seed(place, states(4, speed=SPEED), delay=0.1)
        ends.append(drive(place, 80, accel=np.array([1.5, 0.0, -2.0, 0.5]), tire=ANGLE)[:, -1])
    assert np.hypot(*(ends[0] - ends[1])[:, :2].T).max() < 0.5
    assert ends[0][:, 3] == pytest.approx(ends[1][:, 3], abs=0.1)


def test_a_step_begins_where_the_last_one_ended_whoever_else_is_there() -> None:
    alone, among = stage("multibody"), stage("multibody")
    seed(alone, states(1, speed=9.0))
    seed(among, states(4, speed=np.array([9.0, 3.0, 20.0, 0.0])))
    one = drive(alone, 20, accel=1.0, tire=0.1)[0]
    assert np.array_equal(one, drive(among, 20, accel=1.0, tire=0.1)[0])
    seed(among, states(1, speed=9.0))
    assert np.array_equal(one, drive(among, 20, accel=1.0, tire=0.1)[0])


def test_it_leans_on_its_springs_and_turns_in_later_than_the_twin() -> None:
    rates = []
    engines: tuple[EngineName, EngineName] = ("mujoco", "multibody")
    for engine in engines:
        place = stage(engine, nsim=1)
        seed(place, states(1, speed=15.0))
        rates.append(drive(place, 8, tire=0.05)[0, :, 5])
    assert rates[1][3] < rates[0][3]
    assert rates[1][-1] == pytest.approx(rates[0][-1], rel=0.15)


def test_brakes_stop_it_and_hold_it_and_its_reverse_gear_drives_it_back() -> None:
    place = stage("multibody", nsim=2)
    place.seed(
        states(2, speed=np.array([6.0, 0.0])),
        steering_delay_s=np.zeros(2),
        friction_factor=np.ones(2),
        backwards=np.array([False, True]),
    )
    for _ in range(60):
        place.step(Controls(np.array([-4.0, 1.0]), np.zeros(2)))
    assert place.states[0, 3] == 0.0
    assert place.states[0, 0] == pytest.approx(6.0**2 / 8.0, rel=0.1)
    assert place.states[1, 3] == pytest.approx(-3.0 / CAR.wheel_inertia_mass_factor.value, rel=0.02)
    assert place.states[1, 0] < -3.0


def test_on_ice_wheels_lock_since_it_has_no_slip_control_of_its_own() -> None:
    place = stage("multibody", nsim=2)
    seed(place, states(2, speed=10.0), friction=np.array([1.0, 0.3]))
    ends = drive(place, 30, accel=-6.0)[:, -1]
    assert ends[0, 3] < 1.5
    assert ends[1, 3] > 4.0


def test_mass_and_tyres_are_those_of_the_vehicle_file() -> None:
    soft = altered(CAR, front_cornering_stiffness_npr=60_000.0)
    turned = []
    for car in (CAR, soft):
        place = stage_for("multibody", None, car, nsim=1)
        seed(place, states(1, speed=12.0))
        turned.append(drive(place, 40, tire=0.05)[0, -1, 2])
    assert turned[1] < 0.85 * turned[0]
