from __future__ import annotations

import numpy as np
import pytest

from foretwin.contracts.vehicle import VehicleParameters
from foretwin.sim_worker.batch.batch_simulation import BatchSimulation, Controls
from foretwin.sim_worker.engines.actuators import Actuators
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from tests.sim_worker.driving import altered, seed, states

CAR = load_vehicle()
LATE = altered(CAR, steering_lag_s=0.12, drive_lag_s=0.3, brake_lag_s=0.1, accel_delay_s=0.08)


def actuators(car: VehicleParameters, delay_s: float, *, backwards: bool = False) -> Actuators:
    return Actuators(
        car,
        states=states(1, speed=8.0),
        friction=np.array([car.friction.value]),
        steering_delay_s=np.array([delay_s]),
        backwards=np.array([backwards]),
        steps=5,
    )


@pytest.mark.parametrize("car", [CAR, LATE], ids=["prompt", "late"])
@pytest.mark.parametrize("delay_s", [0.0, 0.1, 0.25, 1.0])
def test_the_tyres_turn_as_those_of_the_twin(car: VehicleParameters, delay_s: float) -> None:
    twin, ours = BatchSimulation(None, car, nsim=1), actuators(car, delay_s)
    seed(twin, states(1, speed=8.0), delay=delay_s)
    for tick in range(40):
        wanted = np.array([0.1 if tick < 15 else -0.1])
        twin.step(Controls(np.zeros(1), wanted))
        now = ours.follow(np.zeros(1), wanted, None).tire_angle_rad[-1]
        # The twin takes its sample at a step's begin, and its servo is not quite a lag.
        assert now == pytest.approx(twin.states[:, 6], abs=0.006)


@pytest.mark.parametrize("car", [CAR, LATE], ids=["prompt", "late"])
@pytest.mark.parametrize("accel", [1.5, -3.0])
def test_they_push_as_hard_as_those_of_the_twin(car: VehicleParameters, accel: float) -> None:
    twin, ours = BatchSimulation(None, car, nsim=1), actuators(car, 0.0)
    seed(twin, states(1, speed=15.0))
    for _ in range(20):
        twin.step(Controls(np.full(1, accel), np.zeros(1)))
        given = ours.follow(np.full(1, accel), np.zeros(1), None)
        push = (given.drive_mps2 - given.brake_mps2) / car.wheel_inertia_mass_factor.value
        assert push == pytest.approx(twin.states[:, 7], abs=0.02)


def test_nothing_is_asked_for_beyond_the_grip_the_drive_and_the_steering() -> None:
    given = actuators(CAR, 0.0).follow(np.array([50.0]), np.array([3.0]), np.array([0.4]))
    assert given.drive_mps2 == CAR.max_drive_accel_mps2.value
    assert given.climb_mps2 == 0.4
    assert given.tire_angle_rad[-1] < 5 * CAR.max_tire_rate_radps.value * 0.01
    held = actuators(CAR, 0.0).follow(np.array([-50.0]), np.zeros(1), None)
    assert held.brake_mps2 == pytest.approx(CAR.friction.value * 9.81)
    assert held.drive_mps2 == 0.0


def test_in_reverse_it_drives_back_and_brakes_all_the_same() -> None:
    given = actuators(CAR, 0.0, backwards=True).follow(np.ones(1), np.zeros(1), None)
    assert given.drive_mps2 == -CAR.drive_gain.value
    assert given.brake_mps2 == 0.0


def test_some_begin_anew_beside_others() -> None:
    two = Actuators(
        LATE,
        states=states(2, tire=0.1),
        friction=np.ones(2),
        steering_delay_s=np.full(2, 0.2),
        backwards=np.zeros(2, dtype=bool),
        steps=5,
    )
    two.follow(np.full(2, 2.0), np.full(2, -0.1), None)
    row = np.array([1])
    two.restart(
        row, states=states(1, tire=0.3), friction=np.ones(1), steering_delay_s=np.array([0.2])
    )
    given = two.follow(np.zeros(2), np.full(2, 0.1), None)
    assert given.tire_angle_rad[:, 1] == pytest.approx(np.full(5, 0.3))
    assert given.tire_angle_rad[-1, 0] == pytest.approx(0.1)


def test_a_delay_of_no_whole_steps_lies_between_its_neighbours() -> None:
    after = [
        actuators(CAR, delay_s).follow(np.zeros(1), np.full(1, 0.1), None).tire_angle_rad[-1, 0]
        for delay_s in (0.02, 0.025, 0.03)
    ]
    assert after[1] == pytest.approx((after[0] + after[2]) / 2.0)
    assert after[0] > after[2]
