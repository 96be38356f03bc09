from __future__ import annotations

import numpy as np
import pytest

from foretwin.contracts.arrays import Array
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.sim_worker.batch.batch_simulation import BatchSimulation
from foretwin.sim_worker.mirror.role_world import RoleWorld
from foretwin.sim_worker.vehicle.lag import ForceLag, lags_of_force
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from tests.sim_worker.driving import altered, drive, seed, states

CAR = load_vehicle()
TICK_S = 0.05


def speeds(vehicle: VehicleParameters, commands: Array, *, start: float = 0.0) -> Array:
    """Speed won by the end of each tick, (N,), under `commands` (N,)."""
    lag = ForceLag(vehicle, tick_s=TICK_S, accel_mps2=np.array([start]))
    accel = [sum(lag.follow(np.array([command]))) for command in commands]
    return np.cumsum(np.concatenate(accel)) * TICK_S


def test_brakes_win_the_speed_of_a_first_order_lag() -> None:
    time_s = TICK_S * np.arange(1, 41)
    car = altered(CAR, brake_lag_s=0.3)
    # v = a (t - T (1 - exp(-t / T)))
    wanted = -4.0 * (time_s - 0.3 * (1 - np.exp(-time_s / 0.3)))
    assert speeds(car, np.full(40, -4.0)) == pytest.approx(wanted)


@pytest.mark.parametrize("delay", [0.1, 0.12, 0.03])
def test_a_dead_time_need_not_be_whole_ticks(delay: float) -> None:
    time_s = TICK_S * np.arange(1, 41)
    car = altered(CAR, accel_delay_s=delay)
    assert speeds(car, np.full(40, 2.0)) == pytest.approx(2.0 * np.maximum(time_s - delay, 0.0))


def test_drive_and_brake_have_lags_of_their_own() -> None:
    car = altered(CAR, drive_lag_s=0.5, brake_lag_s=0.1)
    lag = ForceLag(car, tick_s=TICK_S, accel_mps2=np.array([2.0]))
    for _ in range(20):
        drive_mps2, brake_mps2 = lag.follow(np.array([-6.0]))
    assert brake_mps2 == pytest.approx([-6.0], rel=1e-3)
    assert 0.1 < drive_mps2[0] < 0.5


def test_the_car_that_was_braking_goes_on_as_it_did() -> None:
    car = altered(CAR, brake_lag_s=0.3, accel_delay_s=0.1)
    assert speeds(car, np.full(10, -3.0), start=-3.0) == pytest.approx(
        -3.0 * TICK_S * np.arange(1, 11)
    )


def test_a_vehicle_without_lags_needs_no_filter() -> None:
    assert not lags_of_force(CAR)
    assert lags_of_force(load_vehicle("city_bus"))


@pytest.mark.parametrize("lag", [0.05, 0.2])
def test_tyres_turn_with_the_steering_lag_after_the_delay(lag: float) -> None:
    # A small step, so that the limit of the rate does not matter: it takes 50 ms at 0.4 rad/s.
    car = altered(CAR, steering_lag_s=lag, max_tire_rate_radps=100.0)
    stage = BatchSimulation(None, car, nsim=1)
    seed(stage, states(1, speed=5.0), delay=0.1)
    tire = drive(stage, 20, tire=0.1)[0, :, 6]
    time_s = TICK_S * np.arange(21)
    wanted = 0.1 * (1 - np.exp(-np.maximum(time_s - 0.1, 0.0) / lag))
    assert tire == pytest.approx(wanted, abs=0.01 * 0.1 + 0.05 * 0.1)


def braked(world: RoleWorld, *, ticks: int, accel_mps2: float) -> float:
    """Command the car's twin for some ticks; return its speed."""
    twin = world.twins["car"]
    for _ in range(ticks):
        twin.command(accel_mps2=accel_mps2, tire_angle_rad=0.0)
        world.step()
        twin.read()
    return float(twin.state[3])


def test_the_twin_brakes_with_the_lag_of_its_vehicle() -> None:
    car = altered(CAR, brake_lag_s=0.3, wheel_inertia_mass_factor=1.0)
    speeds_mps = []
    for commanded in (frozenset({"car"}), frozenset[str]()):
        world = RoleWorld(None, {"car": car}, commanded=commanded)
        world.twins["car"].seed(states(1, speed=15.0)[0])
        speeds_mps.append(braked(world, ticks=100, accel_mps2=-4.0))
    won = 4.0 * 0.3 * (1 - np.exp(-1.0 / 0.3))
    assert speeds_mps == pytest.approx([11.0 + won, 11.0], abs=0.01)


def test_a_twin_put_back_forgets_the_brakes_it_was_on() -> None:
    car = altered(CAR, brake_lag_s=0.5, wheel_inertia_mass_factor=1.0)
    world = RoleWorld(None, {"car": car}, commanded=frozenset({"car"}))
    for _ in range(2):
        world.reset()
        world.twins["car"].seed(states(1, speed=15.0)[0])
        assert braked(world, ticks=1, accel_mps2=0.0) == pytest.approx(15.0)
        braked(world, ticks=50, accel_mps2=-8.0)
