from __future__ import annotations

import numpy as np
import pytest

from foretwin.sim_worker.batch.batch_simulation import BatchSimulation
from foretwin.sim_worker.vehicle.parameters import load_vehicle, understeer_gradient
from foretwin.sim_worker.vehicle.reference_points import base_from_cog, cog_from_base
from tests.sim_worker.driving import altered, drive, seed, states

COVERS = ("foretwin.sim_worker.vehicle.actuation", "foretwin.sim_worker.vehicle.reference_points")

CAR = load_vehicle()
UNDERSTEERING = altered(
    CAR, front_cornering_stiffness_npr=90_000.0, rear_cornering_stiffness_npr=130_000.0
)


@pytest.fixture(scope="module")
def stage() -> BatchSimulation:
    return BatchSimulation(None, CAR, nsim=8)


@pytest.mark.parametrize("car", [CAR, UNDERSTEERING], ids=["neutral", "understeering"])
def test_steady_yaw_rate_follows_the_single_track_model(car) -> None:  # type: ignore[no-untyped-def]
    # r = v δ / (L + K v²); Gillespie (1992), eq. 6-18.
    stage = BatchSimulation(None, car, nsim=6)
    speed = np.array([3.0, 5.0, 10.0, 10.0, 15.0, 15.0])
    tire = np.array([0.05, 0.1, 0.05, 0.08, 0.02, 0.04])
    seed(stage, states(6, speed=speed, tire=tire))
    end = drive(stage, 160, tire=tire, hold_speed=speed)[:, -1]
    curvature = np.tan(tire) / (car.wheelbase_m.value + understeer_gradient(car) * speed**2)
    assert end[:, 5] / end[:, 3] == pytest.approx(curvature, rel=0.02)


def test_low_speed_radius_is_kinematic_at_the_rear_axle(stage: BatchSimulation) -> None:
    seed(stage, states(1, speed=1.0, tire=0.4))
    path = drive(stage, 160, tire=0.4, hold_speed=np.ones(1))[0]
    radius = path[-1, 3] / path[-1, 5]
    assert radius == pytest.approx(CAR.wheelbase_m.value / np.tan(0.4), rel=0.01)


def test_braking_distance_is_that_of_the_effective_mass(stage: BatchSimulation) -> None:
    speed = np.array([15.0, 15.0, 10.0])
    decel = np.array([4.0, 8.0, 4.0])
    seed(stage, states(3, speed=speed))
    path = drive(stage, 120, accel=-decel)
    ideal = speed**2 / 2 / (decel / CAR.wheel_inertia_mass_factor.value)
    assert path[:, -1, 0] == pytest.approx(ideal, rel=0.01)


def test_friction_limits_braking_and_cornering(stage: BatchSimulation) -> None:
    friction = np.array([1.0, 0.3])
    seed(stage, states(2, speed=15.0), friction=friction)
    grip = friction * CAR.friction.value * 9.81
    path = drive(stage, 20, accel=-11.5)
    decel = -(path[:, -1, 3] - path[:, 0, 3])
    assert (decel <= grip + 0.1).all()
    assert decel[1] == pytest.approx(grip[1], rel=0.02)
    seed(stage, states(2, speed=15.0), friction=friction)
    path = drive(stage, 40, tire=0.3)
    assert (np.abs(path[:, :, 3] * path[:, :, 5]).max(axis=1) < 1.25 * grip).all()


def test_a_car_that_has_stopped_stays(stage: BatchSimulation) -> None:
    seed(stage, states(2, speed=[5.0, 0.0], tire=0.3))
    path = drive(stage, 200, accel=-3.0, tire=0.3)
    assert path[:, 100:, :3] == pytest.approx(path[:, 100:101, :3].repeat(101, axis=1), abs=1e-3)
    assert np.abs(path[:, -1, 3]).max() < 1e-3


def test_drag_and_rolling_resistance_slow_a_coasting_car_and_never_push_it_back() -> None:
    car = altered(CAR, drag_npv2=0.5, rolling_resistance_n=200.0)
    stage = BatchSimulation(None, car, nsim=2)
    seed(stage, states(2, speed=[20.0, 0.2]))
    path = drive(stage, 40)
    mass = car.mass_kg.value * car.wheel_inertia_mass_factor.value
    assert path[0, 1:, 7].mean() == pytest.approx(-(0.5 * 19.6**2 + 200.0) / mass, rel=0.05)
    assert np.abs(path[1, -1, 3]) < 1e-6


def test_drive_gain_scales_the_reached_acceleration() -> None:
    car = altered(CAR, drive_gain=0.8, wheel_inertia_mass_factor=1.0)
    stage = BatchSimulation(None, car, nsim=1)
    seed(stage, states(1, speed=5.0))
    assert drive(stage, 20, accel=2.0)[0, -1, 3] == pytest.approx(5.0 + 1.6, rel=1e-3)


def test_tyres_turn_no_faster_than_their_limit(stage: BatchSimulation) -> None:
    seed(stage, states(1, speed=5.0))
    tire = drive(stage, 10, tire=0.5)[0, :, 6]
    # The servo overshoots its first command by a tenth.
    assert np.diff(tire).max() <= CAR.max_tire_rate_radps.value * 0.05 * 1.1
    assert tire[-1] == pytest.approx(0.5 * CAR.max_tire_rate_radps.value, abs=0.01)


def test_centre_of_gravity_and_base_link_convert_both_ways() -> None:
    rows = np.random.default_rng(1).normal(size=(5, 8))
    positions, velocities = cog_from_base(CAR, rows)
    back = base_from_cog(CAR, positions, velocities, np.zeros((5, 8)))
    assert back[:, :7] == pytest.approx(rows[:, :7])
    assert np.hypot(*(positions[:, :2] - rows[:, :2]).T) == pytest.approx(1.4227, abs=1e-4)
