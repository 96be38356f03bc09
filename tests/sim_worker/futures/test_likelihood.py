"""How likely and how grave a future is."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.contracts.forecast import PROGRESS_LEVELS, PROGRESS_TIMES_S, ProgressForecast
from foretwin.contracts.futures import Accident, Future, FuturesResult, Job, RoadUserTracks
from foretwin.sim_worker.futures.likelihood import (
    NEAR_MISS,
    occupant_risk,
    pedestrian_risk,
    relative_density,
    risks,
    travelled_m,
)
from foretwin.sim_worker.scenarios.exposure import EXPOSURES
from tests.orchestrator.futures_rounds import round_done, straight

LEVELS, TIMES_S = np.array(PROGRESS_LEVELS), np.array(PROGRESS_TIMES_S)
FORECAST = ProgressForecast(
    time_s=TIMES_S,
    levels=LEVELS,
    # About 10 m/s, more or less by up to a third, growing with the time.
    distance_m=10.0 * TIMES_S[:, None] + np.linspace(-3.0, 3.0, len(LEVELS)) * TIMES_S[:, None],
)


def played(
    *speeds_mps: float, forecast: ProgressForecast | None = FORECAST, **outcome: np.ndarray
) -> tuple[Job, FuturesResult]:
    done = round_done(
        np.concatenate([straight(speed_mps=speed) for speed in speeds_mps]), outcome=outcome
    )
    job = msgspec.structs.replace(done.order.jobs[0], accidents=True)
    if forecast is not None:
        job = msgspec.structs.replace(job, progress=forecast)
    return job, done.results[0]


def with_futures(job: Job, **fields: object) -> Job:
    futures = tuple(msgspec.structs.replace(future, **fields) for future in job.futures)
    return msgspec.structs.replace(job, futures=futures)


def test_a_future_is_the_likelier_the_nearer_its_speed_is_to_the_forecast() -> None:
    likelihood = risks(*played(10.0, 8.0, 6.5, 3.0, 15.0)).likelihood

    assert likelihood[0] == pytest.approx(1.0, abs=0.01)
    assert likelihood[1] == pytest.approx(1.0, abs=0.05)  # the forecast is flat so far out
    assert likelihood[2] > likelihood[3] > 0.0
    assert likelihood[4] < 0.02


def test_without_a_forecast_speeds_are_alike() -> None:
    assert risks(*played(10.0, 2.0, forecast=None)).likelihood == pytest.approx([1.0, 1.0])


def test_what_seldom_happens_is_as_seldom_as_its_scenario() -> None:
    job, result = played(10.0, 10.0)
    happening = risks(with_futures(job, scenario_id="scp"), result).likelihood
    lead = risks(with_futures(job, scenario_id="lead_stopping"), result).likelihood

    assert happening == pytest.approx([EXPOSURES["E2"]] * 2, rel=0.02)
    assert lead == pytest.approx([EXPOSURES["E3"]] * 2, rel=0.02)


def test_a_scenario_that_has_no_place_there_makes_a_future_none_the_less_likely() -> None:
    job, result = played(10.0)
    result = msgspec.structs.replace(result, left_out=("no arm to come from",))

    assert risks(with_futures(job, scenario_id="scp"), result).likelihood == pytest.approx(
        [1.0], abs=0.01
    )


def test_a_car_that_reacts_to_somebody_is_not_the_less_likely_for_it() -> None:
    """It drives as expected for 2 s, then brakes for who crosses."""
    job, result = played(10.0)
    braking = result.trajectory.states.copy()
    braking[0, 21:, 0] = braking[0, 21, 0]
    trajectory = msgspec.structs.replace(result.trajectory, states=braking)
    result = msgspec.structs.replace(result, trajectory=trajectory)
    alone = risks(job, result).likelihood[0]
    reacting = risks(with_futures(job, scenario_id="scp"), result).likelihood[0]

    assert alone < 0.05
    assert reacting == pytest.approx(EXPOSURES["E2"], rel=0.02)


def test_after_a_collision_how_far_it_got_says_nothing() -> None:
    job, result = played(
        10.0, collided=np.array([True]), collision_time_s=np.array([3.05]),
        collision_with=np.array([2]),
    )  # fmt: skip
    states = result.trajectory.states.copy()
    states[0, 31:, 0] = states[0, 31, 0]
    trajectory = msgspec.structs.replace(result.trajectory, states=states)
    found = risks(job, msgspec.structs.replace(result, trajectory=trajectory))

    assert found.likelihood == pytest.approx([1.0], abs=0.01)
    # Into something static at 10 m/s.
    assert found.severity == pytest.approx([occupant_risk(10.0)])
    assert found.criticality == pytest.approx([occupant_risk(10.0)], rel=0.02)


@pytest.mark.parametrize("kind", ["pedestrian", "bicycle", "motorcycle"])
def test_who_is_hit_without_a_car_around_is_worse_off_than_who_sits_in_one(kind: str) -> None:
    job, result = played(
        10.0, 10.0, collided=np.array([True, True]), collision_time_s=np.array([4.0, 4.0]),
        collision_with=np.array([1, 1]),
    )  # fmt: skip
    tracks = RoadUserTracks(
        poses=np.zeros((2, 81, 1, 3), np.float32),
        speed_mps=np.zeros((2, 81, 1), np.float32),
        size_m=np.ones((2, 1, 2), np.float32),
        kinds=np.array([[0], [1]]),
        kind_names=("car", kind),
    )
    accidents = tuple(
        Accident(
            future=place, road_user=0, time_s=4.0, point_m=np.zeros(2), angle_rad=0.0,
            closing_mps=14.0, ego_delta_v_mps=7.0, user_delta_v_mps=7.5,
        )
        for place in range(2)
    )  # fmt: skip
    found = risks(job, msgspec.structs.replace(result, road_users=tracks, accidents=accidents))

    assert found.severity == pytest.approx([occupant_risk(7.5), pedestrian_risk(14.0)])
    assert found.severity[1] > 10.0 * found.severity[0]


def test_a_near_miss_is_less_than_any_collision_and_far_away_is_nothing() -> None:
    """The wall is touched by a car that stands, all but."""
    job, result = played(
        10.0, 10.0, 1e-3, collided=np.array([False, False, True]),
        collision_with=np.array([0, 0, 2]), collision_time_s=np.array([np.nan, np.nan, 2.0]),
        min_clearance_m=np.array([2.5, 0.1, 0.0]),
    )  # fmt: skip
    far, near, hit = risks(job, result).severity.tolist()

    assert far == 0.0
    assert 0.9 * NEAR_MISS < near < hit


def test_a_collision_without_an_accident_is_not_taken_for_a_near_miss() -> None:
    """As one of who overlapped from the start: there is no impact to compute."""
    job, result = played(
        30.0, 30.0, collided=np.array([True, False]), collision_with=np.array([1, 0]),
        collision_time_s=np.array([0.7, np.nan]), min_clearance_m=np.array([0.0, 9.0]),
    )  # fmt: skip

    assert job.accidents
    assert np.isnan(risks(job, result).severity).tolist() == [True, False]


def test_how_grave_a_collision_is_that_was_not_run_on_nobody_knows() -> None:
    job, result = played(
        10.0, 10.0, 10.0, collided=np.array([True, True, False]),
        collision_with=np.array([1, 2, 0]), collision_time_s=np.array([2.0, 2.0, np.nan]),
    )  # fmt: skip
    found = risks(msgspec.structs.replace(job, accidents=False), result).criticality

    assert np.isnan(found).tolist() == [True, False, False], "a wall is hit by how fast one drives"


def test_a_future_that_is_not_valid_is_neither_likely_nor_grave() -> None:
    found = risks(*played(10.0, 10.0, valid=np.array([True, False])))

    assert found.likelihood[1] == found.criticality[1] == 0.0


def test_risks_are_those_of_their_sources() -> None:
    mph = 0.44704
    assert [occupant_risk(v * mph) for v in (30, 40, 50)] == pytest.approx(
        [0.03, 0.17, 0.60], abs=0.02
    )
    assert pedestrian_risk(50.0 / 3.6) == pytest.approx(0.08, abs=0.005)


@given(st.lists(st.floats(0.0, 30.0), min_size=1, max_size=6))
def test_likelihoods_lie_between_nothing_and_one(speeds: list[float]) -> None:
    found = risks(*played(*speeds))

    assert (found.likelihood > 0.0).all()
    assert (found.likelihood <= 1.0).all()


def test_density_is_one_where_it_is_densest_and_falls_to_both_sides() -> None:
    distance = FORECAST.distance_m[3:4] + np.zeros((1, 1))
    inside = relative_density(FORECAST, distance, [3])[0]
    beyond = relative_density(FORECAST, np.array([[20.0, 24.0, 56.0, 60.0]]), [3])[0]

    assert inside.max() == 1.0
    assert beyond[0] < beyond[1] < inside.min()
    assert beyond[3] < beyond[2] < inside.min()


def test_a_way_is_the_sum_of_its_steps_whatever_its_direction() -> None:
    there = straight(speed_mps=10.0)
    back = there.copy()
    back[0, 41:, 0] = 40.0 - (there[0, 41:, 0] - 40.0)

    assert travelled_m(back)[0, -1] == pytest.approx(80.0)


def test_futures_keep_their_places_where_some_could_not_be_staged() -> None:
    job, result = played(10.0, 10.0, 10.0)
    futures = (Future(index=7, name="unplaced", scenario_id="scp"), *job.futures)
    assert risks(msgspec.structs.replace(job, futures=futures), result).likelihood.shape == (3,)
