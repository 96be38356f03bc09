from __future__ import annotations

import numpy as np
import pytest

from foretwin.sim_worker.vehicle.parameters import load_vehicle
from tests.sim_worker.driving import altered
from tests.sim_worker.vehicle_fidelity import STOPS, fidelity, lateral_cases, understeer_errors

CAR = load_vehicle()
UNDERSTEERING = altered(
    CAR, front_cornering_stiffness_npr=90_000.0, rear_cornering_stiffness_npr=130_000.0
)


def test_an_understeering_car_turns_as_the_formula_says() -> None:
    cases = ((10.0, 0.05), (15.0, 0.04), (15.0, 0.0575))
    assert np.abs(understeer_errors(UNDERSTEERING, cases)).max() < 0.005


@pytest.mark.parametrize("name", ["lorry_12t", "city_bus"])
def test_heavy_vehicles_turn_as_the_formula_says(name: str) -> None:
    vehicle = load_vehicle(name)
    assert np.abs(understeer_errors(vehicle, lateral_cases(vehicle))).mean() < 0.01


@pytest.mark.judge
@pytest.mark.parametrize("name", ["ford_escort", "bmw_320i", "vw_vanagon"])
def test_cars_drive_as_the_multi_body_model(name: str) -> None:
    got = fidelity(name, "multi-body")
    assert np.abs(got.radius).mean() < 0.009
    assert got.step_steer.max() < 0.015
    # At 8 m/s², the van's rear wheels lock in the multi-body model, which knows no ABS: see
    # vw_vanagon.toml.
    comparable = [decel < 8.0 or name != "vw_vanagon" for _, decel in STOPS]
    assert np.abs(got.braking[comparable]).max() < 0.015


@pytest.mark.judge
@pytest.mark.parametrize("name", ["bmw_320i", "vw_vanagon"])
def test_cars_without_roll_steer_drive_as_the_single_track_model(name: str) -> None:
    got = fidelity(name, "single-track")
    assert np.abs(got.radius).mean() < 0.005
    assert got.step_steer.max() < 0.01
    assert np.abs(got.braking).max() < 0.01
