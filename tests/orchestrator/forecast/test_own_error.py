"""Forecasts are no surer than the car is of its own speed."""

from __future__ import annotations

import numpy as np
import pytest

from foretwin.contracts.forecast import PROGRESS_LEVELS, ProgressForecast
from foretwin.orchestrator.forecast.own_error import distance_std_m, with_own_error

TIME_S = np.array([1.0, 2.0, 8.0])
LEVELS = np.array(PROGRESS_LEVELS)


def forecast(width_m: float) -> ProgressForecast:
    """Even spreads around 10 m for each second."""
    return ProgressForecast(
        time_s=TIME_S,
        levels=LEVELS,
        distance_m=10.0 * TIME_S[:, None] + width_m * (LEVELS - 0.5),
    )


def test_a_speed_without_error_changes_nothing() -> None:
    told = forecast(2.0)

    assert with_own_error(told, 0.0) is told


def test_a_constant_error_grows_with_time_and_a_fading_one_with_its_root() -> None:
    std_m = distance_std_m(np.array([0.01, 100.0, 400.0]), 0.5)

    assert std_m[0] == pytest.approx(0.005, rel=0.01)
    assert std_m[2] / std_m[1] == pytest.approx(2.0, rel=0.01)


def test_a_narrow_forecast_becomes_as_wide_as_the_cars_own_error() -> None:
    wide = with_own_error(forecast(0.2), 0.5)

    own_m = distance_std_m(TIME_S, 0.5)
    assert wide.at(0.9) - wide.at(0.5) == pytest.approx(1.2816 * own_m, rel=0.03)
    np.testing.assert_allclose(wide.median_m, 10.0 * TIME_S, atol=0.02)


def test_a_wide_forecast_hardly_widens() -> None:
    told = forecast(30.0)
    wide = with_own_error(told, 0.1)

    assert wide.at(0.9)[0] == pytest.approx(told.at(0.9)[0], abs=0.01)
    assert (np.diff(wide.distance_m, axis=1) > 0.0).all()
    assert (wide.distance_m >= 0.0).all()


def test_what_a_car_really_goes_lies_in_the_band_as_often_as_it_says() -> None:
    """A car whose speed is off by a fading error, and that measures what it was to."""
    random = np.random.default_rng(3)
    std_mps, step_s, count = 0.5, 0.05, 4000
    error = std_mps * random.standard_normal(count)
    off_m = np.zeros(count)
    keeps = np.exp(-step_s)
    for _ in range(40):
        off_m += step_s * error
        error = keeps * error + std_mps * np.sqrt(1.0 - keeps**2) * random.standard_normal(count)
    measured = 20.0 + 1.0 * random.standard_normal(count)
    normal = np.quantile(20.0 + random.standard_normal(100_000), LEVELS)
    told = ProgressForecast(time_s=np.array([2.0]), levels=LEVELS, distance_m=normal[None])
    wide = with_own_error(told, std_mps)

    def held(by: ProgressForecast) -> float:
        went = measured - off_m
        return float(np.mean((went >= by.at(0.1)[0]) & (went <= by.at(0.9)[0])))

    assert held(told) < 0.74
    assert held(wide) == pytest.approx(0.8, abs=0.02)
