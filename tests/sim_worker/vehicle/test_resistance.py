"""What slows a rolling car down, against the formulas of drag and rolling."""

from __future__ import annotations

import numpy as np
import pytest

from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.sim_worker.vehicle.resistance import resistance_mps2
from tests.sim_worker.driving import altered

MASS_KG = 1000.0
CAR = altered(load_vehicle(), mass_kg=MASS_KG, drag_npv2=0.4, rolling_resistance_n=150.0)


def test_drag_grows_with_the_square_of_the_speed_and_rolling_is_the_same_at_any() -> None:
    found = resistance_mps2(CAR, np.array([10.0, 20.0]))
    assert MASS_KG * found == pytest.approx([0.4 * 100.0 + 150.0, 0.4 * 400.0 + 150.0])


def test_backwards_it_slows_as_well_and_a_car_that_stands_is_not_pushed() -> None:
    assert resistance_mps2(CAR, np.array([-10.0])) == pytest.approx([-0.19])
    assert resistance_mps2(CAR, np.array([0.0])) == pytest.approx([0.0])


def test_without_either_there_is_none() -> None:
    free = altered(CAR, drag_npv2=0.0, rolling_resistance_n=0.0)
    assert not resistance_mps2(free, np.array([-3.0, 30.0])).any()
