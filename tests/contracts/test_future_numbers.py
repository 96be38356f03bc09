"""The numbers of a future: its own, and those that its scenario draws."""

from __future__ import annotations

import pytest

from foretwin.contracts.future_numbers import check_futures, numbers_of
from foretwin.contracts.futures import Future
from foretwin.contracts.numbers import FUTURE_NUMBERS


def test_the_nominal_future_has_neutral_numbers() -> None:
    neutral = {name: row.neutral for name, row in FUTURE_NUMBERS.items()}
    assert numbers_of(Future(index=0, name="nominal")) == neutral


def test_a_number_of_its_own_joins_that_of_its_scenario() -> None:
    found = numbers_of(
        Future(
            index=1,
            name="slippery",
            numbers={"friction_factor": 0.5, "steering_offset_rad": 0.1},
            scenario_id="ice",
            values={"faults.friction_factor": 0.4, "faults.steering_offset_rad": 0.2},
        )
    )
    assert found["friction_factor"] == 0.5 * 0.4
    assert found["steering_offset_rad"] == pytest.approx(0.3)


def test_what_no_scenario_draws_does_not_count() -> None:
    future = Future(index=1, name="plain", values={"faults.friction_factor": 0.4})
    assert numbers_of(future)["friction_factor"] == 1.0


def test_an_unknown_number_is_named_with_those_that_are_known() -> None:
    with pytest.raises(ValueError, match="'grip'; known: target_speed_factor"):
        numbers_of(Future(index=1, name="x", numbers={"grip": 1.0}))


def test_of_several_futures_each_has_an_index_of_its_own_and_numbers_that_there_are() -> None:
    plain = [Future(index=index, name=str(index)) for index in (0, 1, 2)]
    check_futures(plain)
    with pytest.raises(ValueError, match="two of index 1; each needs one of its own"):
        check_futures([*plain, Future(index=2, name="c"), Future(index=1, name="b")])
    with pytest.raises(ValueError, match="future 'late': brake_gain reaches -1"):
        check_futures([*plain, Future(index=3, name="late", numbers={"brake_gain": -1.0})])
