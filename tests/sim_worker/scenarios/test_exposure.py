"""How often what a future plays happens."""

from __future__ import annotations

import pytest

from foretwin.contracts.futures import Future
from foretwin.sim_worker.scenarios.exposure import (
    _CLASSES,
    EXPOSURES,
    HEEDLESS,
    HEEDLESS_PLANNER,
    SLIPPERY,
    WET,
    exposure_of,
    prior,
)
from foretwin.sim_worker.scenarios.reading import catalogue


def of(*, happens: bool = True, mixed: bool = False, **fields: object) -> float:
    future = Future(index=1, name="one", **fields)  # type: ignore[arg-type]
    return prior(future, happens=happens, mixed_planners=mixed)


def test_the_table_names_scenarios_of_the_catalogue_alone() -> None:
    assert _CLASSES.keys() <= catalogue().keys()


def test_classes_are_in_order_and_parts_of_all_passages() -> None:
    values = [EXPOSURES[name] for name in ("E1", "E2", "E3", "E4")]

    assert values == sorted(values)
    assert values[0] == pytest.approx(5e-5)
    assert values[-1] < 1.0


def test_nothing_unusual_is_certain_whatever_its_speed() -> None:
    assert of() == 1.0
    assert of(numbers={"target_speed_factor": 0.6, "target_speed_offset_mps": 1.0}) == 1.0


@pytest.mark.parametrize(("friction", "part"), [(0.3, SLIPPERY), (0.7, WET), (0.95, 1.0)])
def test_slippery_roads_are_rarer_than_wet_ones(friction: float, part: float) -> None:
    assert of(numbers={"friction_factor": friction}) == pytest.approx(part)


def test_a_fault_is_rare_and_two_of_one_car_are_one() -> None:
    one = of(numbers={"extra_steering_delay_s": 0.2})
    two = of(numbers={"extra_steering_delay_s": 0.2, "brake_gain": 0.5})

    assert one == two == EXPOSURES["E1"]


def test_cars_wander_by_decimetres() -> None:
    assert of(numbers={"lateral_shift_m": 0.25}) == pytest.approx(0.607, abs=0.001)
    assert of(numbers={"lateral_shift_m": -0.8}) < 0.01


def test_what_a_scenario_draws_belongs_to_it() -> None:
    drawn = {"scenario_id": "low_friction", "values": {"faults.friction_factor": 0.3}}

    assert of(**drawn) == EXPOSURES[exposure_of("low_friction")]


def test_a_users_own_scenario_is_taken_as_happening_a_few_times_a_year() -> None:
    assert exposure_of("my_own") == "E2"
    assert of(scenario_id="my_own") == EXPOSURES["E2"]
    assert of(scenario_id="my_own", happens=False) == 1.0


def test_who_heeds_nobody_is_rare_among_others_and_not_where_all_are_so() -> None:
    assert of(planner=HEEDLESS_PLANNER, mixed=True) == HEEDLESS
    assert of(planner=HEEDLESS_PLANNER) == 1.0
