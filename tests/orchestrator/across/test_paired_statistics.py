from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.orchestrator.across.paired_statistics import adjusted, paired_change


def test_a_change_that_all_places_share_is_sure() -> None:
    change = paired_change(np.full(20, 2.0) + np.linspace(-0.1, 0.1, 20), list(range(20)))

    assert change.units == 20
    assert change.mean == pytest.approx(2.0)
    assert change.low is not None
    assert change.high is not None
    assert 1.9 < change.low < 2.0 < change.high < 2.1
    assert change.p_value is not None
    assert change.p_value < 0.01


def test_of_many_pairs_at_few_places_places_count_where_they_suffice() -> None:
    """Eight places, a hundred equal pairs each: what differs between places is the chance."""
    at_places = np.array([1.0, -1.0, 1.2, -0.9, 0.8, -1.1, 1.0, -0.5])
    differences, places = np.repeat(at_places, 100), np.repeat(np.arange(8), 100)

    change = paired_change(differences, places.tolist())

    assert change.units == 8
    assert change.low is not None
    assert change.high is not None
    assert change.low < 0.0 < change.high
    assert change.p_value is not None
    assert change.p_value > 0.5


def test_places_with_more_pairs_weigh_more() -> None:
    differences = np.array([1.0] * 30 + [0.0] * 5)

    change = paired_change(differences, ["large"] * 30 + ["a", "b", "c", "d", "e"])

    assert change.mean == pytest.approx(30 / 35)
    assert change.high is not None
    assert change.high > 30 / 35


@pytest.mark.parametrize("places", [1, 5])
def test_however_many_pairs_too_few_places_say_nothing(places: int) -> None:
    """Four hundred futures of five approaches are five approaches."""
    few = paired_change(np.full(400, 1.5), [number % places for number in range(400)])

    assert few == (1.5, None, None, None, places)


def test_six_places_that_agree_are_the_fewest_that_are_sure() -> None:
    assert paired_change(np.ones(60), [n % 6 for n in range(60)]).p_value == 2 * 0.5**6


def test_no_change_is_no_change() -> None:
    assert paired_change(np.zeros(9), list(range(9)))[:4] == (0.0, 0.0, 0.0, 1.0)


@given(st.lists(st.floats(-5.0, 5.0), min_size=6, max_size=12).filter(any))
def test_an_interval_holds_the_mean_and_is_the_same_again(values: list[float]) -> None:
    differences = np.array(values)

    change = paired_change(differences, list(range(len(values))))

    assert change.low is not None
    assert change.high is not None
    assert change.low - 1e-9 <= change.high
    assert min(values) - 1e-9 <= change.low
    assert change.high <= max(values) + 1e-9
    assert paired_change(differences, list(range(len(values)))) == change


def test_of_many_tests_the_p_values_grow() -> None:
    assert adjusted([0.01, None, 0.04, 0.03]) == [
        pytest.approx(0.03), None, pytest.approx(0.04), pytest.approx(0.04),
    ]  # fmt: skip
    assert adjusted([None]) == [None]
