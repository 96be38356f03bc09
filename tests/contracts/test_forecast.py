"""Quantiles of how far the car gets: shares, values, tails, and what a forecast costs."""

from __future__ import annotations

from statistics import NormalDist

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.contracts.forecast import (
    LEAST_APART_M,
    PROGRESS_LEVELS,
    PROGRESS_TIMES_S,
    ProgressForecast,
    crps_of,
    rising,
    share_below,
    value_at,
)

LEVELS = np.array(PROGRESS_LEVELS)


def even(low_m: float, high_m: float) -> ProgressForecast:
    """One instant, whose quantiles lie evenly from low to high."""
    return ProgressForecast(
        time_s=np.array([1.0]),
        levels=LEVELS,
        distance_m=np.linspace(low_m, high_m, len(LEVELS))[None],
    )


def test_a_forecast_is_told_each_second_up_to_eight_by_every_twentieth() -> None:
    assert tuple(range(1, 9)) == PROGRESS_TIMES_S
    assert pytest.approx(np.linspace(0.05, 0.95, 19)) == LEVELS
    assert LEAST_APART_M == 0.01, "no car is known to a centimetre"


def test_a_median_lies_in_the_middle_and_other_levels_where_they_are() -> None:
    forecast = even(10.0, 28.0)

    assert forecast.median_m == pytest.approx([19.0])
    assert forecast.at(0.1) == pytest.approx([11.0])
    assert forecast.at(0.125) == pytest.approx([11.5])


@given(
    level=st.one_of(st.sampled_from(PROGRESS_LEVELS), st.floats(0.001, 0.999)),
    seed=st.integers(0, 99),
)
def test_a_level_is_the_same_to_the_last_bit_as_among_many_shares(level: float, seed: int) -> None:
    distance_m = rising(np.random.default_rng(seed).uniform(0.0, 90.0, (8, len(LEVELS))))
    forecast = ProgressForecast(time_s=np.arange(8.0), levels=LEVELS, distance_m=distance_m)

    alone = value_at(LEVELS, distance_m, np.full((8, 1), level))[:, 0]
    assert forecast.at(level).tolist() == alone.tolist()
    if LEVELS[0] <= level <= LEVELS[-1]:
        between = [float(np.interp(level, LEVELS, row)) for row in distance_m]
        assert alone.tolist() == between


@given(share=st.floats(1e-6, 1.0 - 1e-6), width_m=st.floats(0.5, 80.0))
def test_a_share_and_its_value_undo_each_other_in_the_tails_too(
    share: float, width_m: float
) -> None:
    distance_m = even(3.0, 3.0 + width_m).distance_m
    value = value_at(LEVELS, distance_m, np.array([[share]]))

    assert share_below(LEVELS, distance_m, value) == pytest.approx(share, rel=1e-6, abs=1e-9)


def test_shares_rise_from_nothing_to_all_however_far_away_a_value_is() -> None:
    values = np.linspace(-1e5, 1e5, 2001)[None]
    shares = share_below(LEVELS, even(0.0, 1.0).distance_m, values)[0]

    assert (np.diff(shares) >= 0.0).all()
    assert shares[0] == pytest.approx(0.0, abs=1e-12)
    assert shares[-1] == pytest.approx(1.0, abs=1e-12)


@given(
    st.lists(st.lists(st.floats(-50.0, 50.0), min_size=5, max_size=5), min_size=1, max_size=8).map(
        np.array
    )
)
def test_quantiles_that_cross_are_put_in_order_and_apart_and_no_car_goes_back(
    crossed: np.ndarray,
) -> None:
    found = rising(crossed)

    assert (np.diff(found, axis=1) >= LEAST_APART_M - 1e-9).all()
    assert (np.diff(found, axis=0) >= -1e-9).all()
    assert found[0, 0] == max(crossed[0].min(), 0.0)


def test_the_score_of_a_uniform_forecast_is_its_crps() -> None:
    """Of one over a metre whose middle comes: 1/12 m."""
    fine = (np.arange(2000) + 0.5) / 2000

    assert crps_of(fine, fine[None], np.array([0.5])) == pytest.approx(1.0 / 12.0, abs=1e-4)


def test_an_honest_normal_forecast_scores_what_it_must_and_a_point_its_distance() -> None:
    """Expected CRPS of a normal distribution: 1/√π deviations (Gneiting, Raftery 2007, 4.2)."""
    told = np.array([NormalDist().inv_cdf(level) for level in PROGRESS_LEVELS])
    came = np.array([NormalDist().inv_cdf((k + 0.5) / 2000) for k in range(2000)])

    scores = crps_of(LEVELS, np.broadcast_to(told, (len(came), len(told))), came)
    assert scores.mean() == pytest.approx(np.pi**-0.5, rel=0.002)
    point = crps_of(LEVELS, np.full((2, len(told)), 3.0), np.array([1.0, 7.5]))
    assert point == pytest.approx([2.0, 4.5])
