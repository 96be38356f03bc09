"""Between when and when a car arrives, of forecasts whose courses are known."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.contracts.forecast import PROGRESS_LEVELS, PROGRESS_TIMES_S, ProgressForecast
from foretwin.orchestrator.rounds.arrival_band import ArrivalBand, arrival_band

TIMES_S = np.array(PROGRESS_TIMES_S)
LEVELS = np.array(PROGRESS_LEVELS)


def steady(slowest_mps: float, fastest_mps: float) -> ProgressForecast:
    """Each quantile drives at a speed of its own, p10 and p90 at those given."""
    speeds = np.interp(LEVELS, (0.1, 0.9), (slowest_mps, fastest_mps))
    return of_courses(TIMES_S[:, None] * speeds)


def of_courses(distance_m: np.ndarray) -> ProgressForecast:
    return ProgressForecast(time_s=TIMES_S, levels=LEVELS, distance_m=distance_m)


def stopping(speed_mps: float, decel_mps2: float, *, fastest_mps: float) -> ProgressForecast:
    """Up to p50 brakes to a stand, the rest goes on."""
    until = np.minimum(TIMES_S, speed_mps / decel_mps2)
    stops = speed_mps * until - 0.5 * decel_mps2 * until**2
    goes = fastest_mps * TIMES_S
    return of_courses(np.where(LEVELS <= 0.5, stops[:, None], goes[:, None]))


@pytest.mark.parametrize("way_m", [3.0, 48.0, 60.0])
def test_within_the_forecast_each_quantile_arrives_when_it_has_got_so_far(way_m: float) -> None:
    band = arrival_band(steady(8.0, 12.0), way_m, usual_mps=12.0)

    assert band == pytest.approx((way_m / 12.0, way_m / 8.0))


def test_beyond_the_forecast_steady_quantiles_go_on() -> None:
    band = arrival_band(steady(8.0, 12.0), 120.0, usual_mps=12.0)

    assert band == pytest.approx((120.0 / 12.0, 120.0 / 8.0), rel=1e-3)


def test_an_early_car_comes_back_to_the_usual_speed_and_a_late_one_does_not() -> None:
    slow, usual = (
        arrival_band(steady(3.0, 4.0), 60.0, usual_mps=usual_mps) for usual_mps in (4.0, 12.0)
    )

    assert slow is not None
    assert usual is not None
    assert usual.early_s < slow.early_s - 1.0
    assert usual.late_s == slow.late_s


def test_where_one_of_ten_stands_before_nobody_knows_when_it_comes() -> None:
    forecast = stopping(8.0, 2.0, fastest_mps=9.0)

    assert arrival_band(forecast, 45.0, usual_mps=9.0) == pytest.approx((5.0, None))
    within = arrival_band(forecast, 7.0, usual_mps=9.0)
    assert within is not None
    assert within.late_s is not None


def test_who_still_slows_down_as_the_forecast_ends_goes_on_to() -> None:
    rolls = of_courses(np.repeat((10.0 * TIMES_S - 0.5 * TIMES_S**2)[:, None], len(LEVELS), axis=1))
    band = arrival_band(rolls, 60.0, usual_mps=10.0)

    assert rolls.distance_m[-1, 0] == pytest.approx(48.0)
    assert band is not None
    assert band.late_s is None or band.late_s > 8.0 + 12.0 / 2.0  # 2 m/s are left at 8 s


@pytest.mark.parametrize("usual_mps", [14.0, 6.0])
def test_beyond_the_forecast_speeds_go_from_the_last_to_another_and_a_trend_fades(
    usual_mps: float,
) -> None:
    """p90 drives at 10 m/s and comes back to the usual speed within 24 s; p10 loses 0.4 m/s each
    second, which fades within 3 s."""
    early_m, late_m = 10.0 * TIMES_S, 10.0 * TIMES_S - 0.2 * TIMES_S**2
    share = np.interp(LEVELS, (0.1, 0.9), (0.0, 1.0))
    forecast = of_courses(late_m[:, None] + share * (early_m - late_m)[:, None])

    def way_m(
        after_s: float, from_m: float, last_mps: float, to_mps: float, within_s: float
    ) -> float:
        fading_s = within_s * (1.0 - np.exp(-after_s / within_s))
        return from_m + to_mps * after_s + (last_mps - to_mps) * float(fading_s)

    early = arrival_band(forecast, way_m(16.0, 80.0, 10.0, usual_mps, 24.0), usual_mps=usual_mps)
    assert early is not None
    assert early.early_s == pytest.approx(24.0, abs=0.003)
    # In the last second 7 m: so the last speed is told, and the trend by quarters of the time.
    late = arrival_band(forecast, way_m(6.1, 67.2, 7.0, 7.0 - 3.0 * 0.4, 3.0), usual_mps=usual_mps)
    assert late is not None
    assert late.late_s == pytest.approx(14.1, abs=0.003)


@pytest.mark.parametrize(("in_s", "told"), [(59.9, True), (60.3, False)])
def test_what_is_more_than_a_minute_ahead_is_not_told(in_s: float, told: bool) -> None:
    crawls = steady(1.0, 1.0)
    assert (arrival_band(crawls, in_s, usual_mps=1.0) is not None) == told
    late = arrival_band(steady(1.0, 2.0), in_s, usual_mps=2.0)
    assert late is not None
    assert (late.late_s is not None) == told


def test_a_car_that_is_there_is_there() -> None:
    assert arrival_band(steady(8.0, 12.0), 0.0, usual_mps=12.0) == (0.0, 0.0)


@given(near=st.floats(0.0, 300.0), more=st.floats(0.0, 300.0), slow=st.floats(0.2, 10.0))
def test_early_is_not_after_late_and_farther_not_before_nearer(
    near: float, more: float, slow: float
) -> None:
    forecast = steady(slow, slow + 4.0)
    first, then = (arrival_band(forecast, m, usual_mps=10.0) for m in (near, near + more))

    assert first is None or first.late_s is None or first.early_s <= first.late_s + 1e-9
    if first is not None and then is not None:
        assert first.early_s <= then.early_s + 1e-9


def test_what_is_shown_lies_within() -> None:
    assert ArrivalBand(6.0, 9.0).around(5.0) == (5.0, 9.0)
    assert ArrivalBand(6.0, 9.0).around(10.0) == (6.0, 10.0)
    assert ArrivalBand(6.0, None).around(7.0) == (6.0, None)
