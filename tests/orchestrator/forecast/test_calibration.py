"""Levels are moved to where what came lay."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.contracts.forecast import PROGRESS_LEVELS, ProgressForecast
from foretwin.orchestrator.forecast.calibration import HALF_LIFE_S, Calibration, shares_of

LEVELS = np.array(PROGRESS_LEVELS)
ONE_S = np.array([1.0])


def forecast(width_m: float = 10.0, instants: int = 1) -> ProgressForecast:
    quantiles = 20.0 + width_m * (LEVELS - 0.5)
    return ProgressForecast(
        time_s=np.arange(1.0, instants + 1.0),
        levels=LEVELS,
        distance_m=np.repeat(quantiles[None], instants, axis=0),
    )


def held(calibration: Calibration, came_m: np.ndarray, told: ProgressForecast) -> float:
    """Which part of what comes lies from p10 to p90, each counted before the next."""
    inside = []
    for k, value in enumerate(came_m):
        now = calibration.calibrated(told)
        inside.append(now.at(0.1)[0] <= value <= now.at(0.9)[0])
        share = float(shares_of(told, np.array([[value]]))[0, 0])
        calibration.take(0, 0.5 * k, share)
    return float(np.mean(inside[1000:]))


@pytest.mark.parametrize(
    ("true_width_m", "bias_m"), [(4.0, 0.0), (25.0, 0.0), (4.0, 4.0), (10.0, -3.0), (25.0, 4.0)]
)
def test_a_band_that_is_too_narrow_too_wide_or_aside_comes_to_hold_its_share(
    true_width_m: float, bias_m: float
) -> None:
    random = np.random.default_rng(5)
    came = 20.0 + bias_m + true_width_m * (random.random(3000) - 0.5)

    assert held(Calibration(ONE_S), came, forecast()) == pytest.approx(0.8, abs=0.04)


def test_an_honest_forecast_stays_where_it_is() -> None:
    """As much came in each part of it as it said; places of the grid are up to 0.25 m apart."""
    calibration, told = Calibration(ONE_S), forecast()
    for k in range(20_000):
        calibration.take(0, 0.0, (k + 0.5) / 20_000)
    now = calibration.calibrated(told)

    assert now.distance_m[0] == pytest.approx(told.distance_m[0], abs=0.002)


def test_both_sides_of_a_forecast_are_moved_alike() -> None:
    one, other = Calibration(ONE_S), Calibration(ONE_S)
    for share in np.random.default_rng(3).beta(2.0, 4.0, 500):
        one.take(0, 0.0, float(share))
        other.take(0, 0.0, float(1.0 - share))
    low, high = (each.calibrated(forecast()).distance_m[0] for each in (one, other))

    assert low - 20.0 == pytest.approx(20.0 - high[::-1], abs=1e-6)


def test_a_driver_who_changes_is_followed_within_some_half_lives() -> None:
    random = np.random.default_rng(6)
    half = round(4 * HALF_LIFE_S / 0.5)
    calm = 20.0 + 4.0 * (random.random(half) - 0.5)
    hasty = 26.0 + 20.0 * (random.random(half) - 0.5)
    calibration = Calibration(ONE_S)
    held(calibration, calm, forecast())

    assert calibration.calibrated(forecast()).median_m[0] == pytest.approx(20.0, abs=0.5)
    for k, value in enumerate(hasty):
        share = float(shares_of(forecast(), np.array([[value]]))[0, 0])
        calibration.take(0, 0.5 * (half + k), share)
    assert calibration.calibrated(forecast()).median_m[0] == pytest.approx(26.0, abs=1.5)


def test_before_anything_came_a_forecast_is_as_it_was_and_instants_are_apart() -> None:
    calibration, told = Calibration(np.arange(1.0, 3.0)), forecast(instants=2)
    assert calibration.calibrated(told) is told
    for k in range(200):
        calibration.take(1, 0.5 * k, 0.9)
    now = calibration.calibrated(told)

    assert now.distance_m[0] == pytest.approx(told.distance_m[0], abs=0.01)
    assert now.median_m[1] > told.median_m[1] + 2.0


def test_a_forecast_that_reaches_farther_is_moved_by_less() -> None:
    """Rounds overlap: those of 8 s say eight times less each than those of 1 s."""
    told = forecast(instants=1)
    moved = []
    for reach_s in (1.0, 8.0):
        calibration = Calibration(np.array([reach_s]))
        for k in range(20):
            calibration.take(0, 0.5 * k, 0.9)
        moved.append(float(calibration.calibrated(told).median_m[0]) - 20.0)

    assert moved[0] > 2.0 * moved[1] > 0.0


@given(st.lists(st.tuples(st.integers(0, 2), st.floats(0.0, 1.0)), max_size=60))
def test_whatever_came_quantiles_rise_and_no_car_goes_back(came: list) -> None:
    calibration, told = Calibration(np.arange(1.0, 4.0)), forecast(40.0, instants=3)
    for k, (instant, share) in enumerate(came):
        calibration.take(instant, 0.5 * k, share)
    distance = calibration.calibrated(told).distance_m

    assert (np.diff(distance, axis=1) > 0.0).all()
    assert (distance >= 0.0).all()


def test_a_copy_and_one_that_travelled_go_on_to_the_same_bits() -> None:
    one = Calibration(ONE_S)
    for k in range(30):
        one.take(0, 0.7 * k, (0.37 * k) % 1.0)
    others = copy.deepcopy(one), pickle.loads(pickle.dumps(one))
    for calibration in (one, *others):
        calibration.take(0, 25.0, 0.2)
    told = [c.calibrated(forecast()).distance_m.tobytes() for c in (one, *others)]

    assert len(set(told)) == 1


def test_where_time_steps_back_what_came_is_forgotten() -> None:
    calibration = Calibration(ONE_S)
    for k in range(50):
        calibration.take(0, 100.0 + k, 0.99)
    calibration.take(0, 1.0, 0.5)

    assert calibration.calibrated(forecast()).median_m[0] == pytest.approx(20.0, abs=0.5)


def test_a_stamp_a_little_out_of_order_costs_nothing() -> None:
    one, other = Calibration(ONE_S), Calibration(ONE_S)
    for k in range(50):
        for calibration in (one, other):
            calibration.take(0, 100.0 + k, 0.9)
    one.take(0, 149.0, 0.9)
    other.take(0, 148.7, 0.9)

    told = [c.calibrated(forecast()).distance_m.tobytes() for c in (one, other)]
    assert told[0] == told[1]
