"""A small car moves in a World as on its lot: lengths by its scale, times the same."""

from __future__ import annotations

from pathlib import Path

import msgspec
import numpy as np
import pytest

from foretwin.contracts.arrays import Array
from foretwin.contracts.errors import UserError
from foretwin.contracts.toml_file import load_toml
from foretwin.contracts.vehicle import VehicleFile, VehicleParameters
from foretwin.sim_worker.batch.batch_simulation import BatchSimulation
from foretwin.sim_worker.vehicle import parameters
from foretwin.sim_worker.vehicle.parameters import check_vehicle, load_vehicle, understeer_gradient
from foretwin.sim_worker.vehicle.similarity import in_world_size
from tests.sim_worker.driving import altered, drive, seed, states
from tests.sim_worker.vehicle.f1tenth import GymCar

SMALL = {"f1tenth": 10.0, "autodrive_nigel": 14.0}
FOLDER = Path(parameters.__file__).parent


def driven(
    vehicle: VehicleParameters, *, speed_mps: float, accel_mps2: float, tire_rad: float
) -> Array:
    """The states (T, 8) of 1.5 s on open ground."""
    stage = BatchSimulation(None, vehicle, nsim=1)
    seed(stage, states(1, speed=speed_mps))
    ran: Array = drive(stage, 30, accel=accel_mps2, tire=tire_rad)[0]
    return ran


def own_size(name: str) -> VehicleParameters:
    file = load_toml(FOLDER / f"{name}.toml", "vehicle").convert(VehicleFile)
    fields = {one: getattr(file, one) for one in VehicleParameters.__struct_fields__}
    return VehicleParameters(**fields)


@pytest.mark.parametrize("name", SMALL)
def test_a_small_car_has_the_size_of_a_road_vehicle_in_a_world(name: str) -> None:
    small, large = own_size(name), load_vehicle(name)
    assert large.wheelbase_m.value == pytest.approx(SMALL[name] * small.wheelbase_m.value)
    assert 1.5 < large.wheelbase_m.value < 4.0
    assert large.max_tire_angle_rad == small.max_tire_angle_rad
    assert large.cog_height_m == small.cog_height_m
    assert large.mass_kg.std == pytest.approx(SMALL[name] ** 3 * (small.mass_kg.std or 0.0))


@pytest.mark.parametrize("name", SMALL)
def test_it_understeers_as_much_per_radius_and_grips_as_much_per_length(name: str) -> None:
    small, large, n = own_size(name), load_vehicle(name), SMALL[name]
    # K is an angle per acceleration, and accelerations are n times as large.
    assert n * understeer_gradient(large) == pytest.approx(understeer_gradient(small), abs=1e-9)
    assert large.friction.value == pytest.approx(n * small.friction.value)
    share = [
        one.cog_height_m.value * one.friction.value / one.wheelbase_m.value
        for one in (small, large)
    ]
    assert share[1] == pytest.approx(share[0])


@pytest.mark.parametrize(
    ("accel_mps2", "tire_rad"), [(0.5, 0.05), (-1.0, 0.1), (0.0, -0.1), (1.0, 0.0)]
)
def test_its_motion_in_a_world_is_that_of_its_own_simulator_on_the_lot(
    accel_mps2: float, tire_rad: float
) -> None:
    # Without what the gym has not: delays, lags, resistances and the spin of wheels.
    car = altered(
        load_vehicle("f1tenth"), steering_delay_s=0.0, steering_lag_s=0.0, drag_npv2=0.0,
        accel_delay_s=0.0, drive_lag_s=0.0, brake_lag_s=0.0, rolling_resistance_n=0.0,
        wheel_inertia_mass_factor=1.0,
    )  # fmt: skip
    in_world = driven(car, speed_mps=30.0, accel_mps2=10.0 * accel_mps2, tire_rad=tire_rad)
    small = GymCar(np.zeros(3), 3.0)
    small.drive(1.5, accel_mps2, tire_rad)
    x_m, y_m, yaw_rad = small.pose()
    # On 4 m of way: here turned tyres hold the car back, which the gym leaves out.
    assert in_world[-1, 0] / 10.0 == pytest.approx(x_m, abs=0.15)
    assert in_world[-1, 1] / 10.0 == pytest.approx(y_m, abs=0.15)
    assert in_world[-1, 2] == pytest.approx(yaw_rad, abs=0.05)


def test_what_no_small_car_can_be_is_refused(tmp_path: Path) -> None:
    text = (FOLDER / "f1tenth.toml").read_text(encoding="utf-8")
    file = tmp_path / "car.toml"
    for old, new, told in (
        ("scale = 10.0", "scale = 1.0", "mass_kg 3.74 is implausible; it must be 150 to 60000"),
        ("scale = 10.0", "scale = 500.0", "scale 500: 1, or of a small car up to 100"),
        ("value = 3.74", "value = 0.01", "mass_kg 0.01 is implausible; it must be 0.15 to 60"),
        ("value = 1.0489", "value = 10.0", "friction 10 is implausible; it must be 0.05 to 2"),
    ):
        assert old in text
        file.write_text(text.replace(old, new), encoding="utf-8")
        with pytest.raises(UserError, match=r"implausible|scale") as refused:
            load_vehicle(file)
        assert told in str(refused.value)


def test_a_small_car_in_a_world_may_be_tuned_though_no_road_vehicle_grips_so() -> None:
    car = load_vehicle("f1tenth")
    grippier = altered(car, friction=11.0)
    assert check_vehicle(grippier, before=car) is grippier
    with pytest.raises(ValueError, match="friction 11 is implausible"):
        check_vehicle(altered(load_vehicle(None), friction=11.0), before=load_vehicle(None))


def test_road_vehicles_stay_as_their_files_say() -> None:
    vehicle = load_vehicle("bmw_320i")
    assert check_vehicle(vehicle) is vehicle
    assert in_world_size(vehicle, 1.0) == vehicle
    assert "scale" not in msgspec.to_builtins(vehicle)
