"""Speeds ahead, half by the law and half by what was learnt."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from foretwin.contracts.drive import VehicleState
from foretwin.contracts.forecast import PROGRESS_LEVELS, PROGRESS_TIMES_S, ProgressForecast
from foretwin.orchestrator.forecast.progress_model import progress_model
from foretwin.orchestrator.instructions import LatestReports, RoundIntent
from foretwin.orchestrator.rounds.jobs import RoundPlanner
from foretwin.orchestrator.rounds.learnt_speed import partly_learnt
from foretwin.orchestrator.rounds.progress_forecasts import ProgressForecasts
from tests.orchestrator.house import House
from tests.orchestrator.trip import town_world

STEADY = np.full(17, 9.0)
TIMES_S = np.array(PROGRESS_TIMES_S)


def forecast(median_m: np.ndarray, times_s: np.ndarray = TIMES_S) -> ProgressForecast:
    levels = np.array(PROGRESS_LEVELS)
    spread = 0.1 * times_s[:, None] * (levels - 0.5)
    return ProgressForecast(time_s=times_s, levels=levels, distance_m=median_m[:, None] + spread)


def distances(speeds_mps: np.ndarray) -> np.ndarray:
    return np.cumsum(0.25 * (speeds_mps[1:] + speeds_mps[:-1]))[1::2]


def test_a_forecast_of_the_same_changes_nothing() -> None:
    np.testing.assert_allclose(partly_learnt(STEADY, forecast(9.0 * TIMES_S)), 9.0, atol=1e-9)


@given(accel=st.floats(-1.0, 1.0))
def test_a_forecast_of_the_same_acceleration_changes_nothing(accel: float) -> None:
    braking_or_not = 9.0 + accel * 0.5 * np.arange(17)
    learnt = forecast(9.0 * TIMES_S + 0.5 * accel * TIMES_S**2)

    np.testing.assert_allclose(partly_learnt(braking_or_not, learnt), braking_or_not, atol=1e-9)


@given(power=st.sampled_from([2, 3, 4]), at_most=st.floats(-8.0, 8.0))
def test_half_of_a_learnt_acceleration_or_jerk_counts(power: int, at_most: float) -> None:
    """What grows with a power of time by so many metres within 8 s."""
    learnt = forecast(9.0 * TIMES_S + at_most * (TIMES_S / 8.0) ** power)
    found = partly_learnt(STEADY, learnt)

    change = at_most * power * (0.5 * np.arange(17)) ** (power - 1) / 8.0**power
    np.testing.assert_allclose(found, 9.0 + 0.5 * change, atol=1e-6)


def test_uneven_quantiles_give_even_speeds() -> None:
    uneven = np.array([0.4, -0.4] * 4)
    found = partly_learnt(STEADY, forecast(9.0 * TIMES_S + uneven))

    assert found[0] == 9.0
    assert np.abs(np.diff(found)).max() < 0.25


def test_a_car_that_is_to_brake_more_does_not_go_back() -> None:
    found = partly_learnt(np.full(17, 2.0), forecast(np.minimum(2.0 * TIMES_S, 3.0)))

    assert found.min() >= 0.0
    assert distances(found)[-1] < 16.0


def test_who_stands_goes_on_standing() -> None:
    assert not partly_learnt(np.zeros(17), forecast(0.4 * TIMES_S)).any()
    assert not partly_learnt(np.array([0.3, *np.zeros(16)]), forecast(0.4 * TIMES_S))[1:].any()


def test_instants_behind_the_horizon_do_not_count() -> None:
    short = partly_learnt(np.full(9, 9.0), forecast(9.0 * TIMES_S + np.maximum(TIMES_S - 4.0, 0.0)))
    too_few = partly_learnt(np.full(5, 9.0), forecast(12.0 * TIMES_S))

    np.testing.assert_allclose(short, 9.0, atol=1e-9)
    np.testing.assert_array_equal(too_few, 9.0)


def test_a_round_with_a_forecast_aims_at_both(tmp_path: Path) -> None:
    house = House(tmp_path)
    house.drive(20)
    intent, latest = house.mission.plan_round(), house.conductor.intake.latest
    assert isinstance(intent, RoundIntent)
    assert latest is not None
    state: VehicleState = latest.state
    world = town_world(intent.junction_id)
    forecasts = ProgressForecasts(progress_model(), horizon_s=8.0)
    for one in house.states[:20]:
        forecasts.take_state(one, 0)
    planner = RoundPlanner(house.plan.config, house.plan.vehicle)
    reports = LatestReports(None, None, ())

    def speeds(progress: ProgressForecasts | None) -> np.ndarray:
        (job, *_) = planner.plan(
            1, intent, state, reports, world, start_stamp_ns=0, count=1, progress=progress
        )
        if progress is not None:
            np.testing.assert_array_equal(
                job.speed_ahead_mps, partly_learnt(intent.speed_ahead_mps, job.progress)
            )
        assert job.bend_accel_mps2 == intent.bend_accel_mps2
        return np.asarray(job.speed_ahead_mps)

    house.tables.close()
    np.testing.assert_array_equal(speeds(None), intent.speed_ahead_mps)
    assert np.abs(speeds(forecasts) - intent.speed_ahead_mps).max() > 0.01
