"""Figures of many values, held against those of all of them."""

from __future__ import annotations

import pickle
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.contracts.running import (
    ACCURACY,
    EXACT,
    MOST_LISTED,
    OTHER_REASONS,
    FirstOf,
    RunningMeans,
    RunningQuantiles,
    with_others,
)
from tests.pages import page

VALUES = st.floats(0.0, 1e11)


def quantiles(values: list[float]) -> RunningQuantiles:
    found = RunningQuantiles()
    for value in values:
        found.take(value)
    return found


def test_the_page_tells_what_is_exact_and_how_much_is_listed() -> None:
    told = f"quantiles exactly up to {EXACT:,} values, within {100 * ACCURACY:g} % beyond"
    assert told in page("results.md")
    assert f"hold their first {MOST_LISTED:,} entries" in page("results.md")


@given(st.lists(VALUES, min_size=1, max_size=50), st.sampled_from([0, 5, 50, 95, 100]))
def test_quantiles_of_a_few_are_exact(values: list[float], q: float) -> None:
    assert quantiles(values).percentile(q) == np.percentile(values, q)


@given(st.integers(0, 2**32 - 1), st.sampled_from([0.0, 50.0, 95.0, 99.9, 100.0]))
def test_quantiles_of_many_are_nearly_so_and_know_no_order(seed: int, q: float) -> None:
    random = np.random.default_rng(seed)
    values = np.concatenate([random.lognormal(2.0, 2.0, EXACT), np.zeros(3), [1e-9, 1e11]])
    nearest = np.percentile(values, q, method="lower")
    found = quantiles(values.tolist()).percentile(q)

    assert found == pytest.approx(nearest, rel=0.0101, abs=1e-9)
    assert found == quantiles(random.permutation(values).tolist()).percentile(q)


def test_quantiles_of_a_day_take_little_memory() -> None:
    random = np.random.default_rng(1)
    found = quantiles(random.lognormal(0.0, 8.0, 200_000).tolist())
    assert len(found._bins) < 3000
    assert found._values is None
    assert sys.getsizeof(found._bins) < 200_000


def test_of_many_none_is_kept_and_small_and_great_ones_are_told_apart() -> None:
    assert quantiles([1.0] * 5_000)._values is None
    for value in (1e-9, 2e-9, 5e11, 1e12):
        assert quantiles([value] * 5_000).percentile(50) == pytest.approx(value, rel=0.0101)
    assert quantiles([0.9e-9] * 5_000).percentile(50) == 0.0


@pytest.mark.parametrize("odd", [-1.0, float("nan")])
def test_what_is_no_age_counts_as_none(odd: float) -> None:
    assert quantiles([odd]).percentile(50) == 0.0
    assert quantiles([float("inf")] * (EXACT + 1)).percentile(50) == pytest.approx(1e12, rel=0.02)
    assert RunningQuantiles().percentile(50) is None


@given(st.lists(st.tuples(VALUES, VALUES), min_size=1), st.integers(0, 100))
def test_means_are_those_of_all_rows(rows: list[tuple[float, float]], cut: int) -> None:
    running = RunningMeans(rows)
    assert running.count == len(rows)
    assert running.means == pytest.approx(np.mean(rows, axis=0))
    both = RunningMeans(rows[:cut]) + RunningMeans(rows[cut:])
    assert (both.count, both.means) == (len(rows), pytest.approx(running.means))
    assert RunningMeans().means == ()


def test_the_first_are_kept_and_the_rest_counted() -> None:
    kept: FirstOf[int] = FirstOf(3)
    kept.append(0)
    kept.extend(range(1, 10))
    assert (kept, kept.left_out) == ([0, 1, 2], 7)


def test_what_was_kept_goes_on_alike_in_another_process() -> None:
    """As it is handed to an orchestrator that goes on with a run."""
    kept: FirstOf[int] = FirstOf(3)
    kept.extend(range(5))
    again = pickle.loads(pickle.dumps(kept))
    for one in (kept, again):
        one.append(7)
        assert (one, one.left_out) == ([0, 1, 2], 3)
    room: FirstOf[int] = pickle.loads(pickle.dumps(FirstOf[int](2)))
    room.extend((8, 9, 10))
    assert (room, room.left_out) == ([8, 9], 1)


def test_counts_and_that_of_all_others_make_up_the_total() -> None:
    assert with_others({"a": 3, "b": 2}, 7) == {"a": 3, "b": 2, OTHER_REASONS: 2}
    assert with_others({"a": 3, "b": 2}, 5) == {"a": 3, "b": 2}
