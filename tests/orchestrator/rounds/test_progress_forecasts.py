"""A round's forecast of the car's progress, and what came of it."""

from __future__ import annotations

import copy
import pickle
from dataclasses import replace

import numpy as np
import pytest

from foretwin.contracts.drive import VehicleState
from foretwin.contracts.forecast import ForecastOutcome, crps_of, share_below
from foretwin.contracts.frames import GeoPoint, LocalFrame, geo_from_local
from foretwin.contracts.futures import PathAhead
from foretwin.orchestrator.forecast.features import CONTROLS
from foretwin.orchestrator.forecast.progress_model import progress_model
from foretwin.orchestrator.instructions import RoundIntent
from foretwin.orchestrator.rounds.progress_forecasts import ProgressForecasts, _ahead
from tests.orchestrator.futures_rounds import round_done, straight
from tests.orchestrator.trip import START_NS

FRAME = LocalFrame(GeoPoint(52.5, 13.4))
PATH = PathAhead(
    xy_m=np.column_stack([np.arange(-10.0, 400.0), np.zeros(410)]), speed_limit_mps=np.full(410, 14)
)
INTENT = RoundIntent(
    junction_id="n4",
    world_id="w",
    path=PATH,
    cruise_speed_mps=10.0,
    speed_ahead_mps=np.full(17, 10.0),
    bend_accel_mps2=2.25,
    next_junction=("signals", 80),
)


def state(
    time_s: float, speed_mps: float = 10.0, *, speed_std_mps: float | None = None
) -> VehicleState:
    lat, lon = geo_from_local(FRAME, np.array([max(0.0, speed_mps * time_s), 0.0]))
    return VehicleState(
        vehicle_id="ego", stamp_ns=START_NS + round(time_s * 1e9),
        position=GeoPoint(float(lat), float(lon)), yaw_rad=0.0, speed_mps=speed_mps,
        yaw_rate_radps=0.0, accel_mps2=0.0, speed_std_mps=speed_std_mps,
    )  # fmt: skip


def drive(
    forecasts: ProgressForecasts,
    *,
    until_s: float,
    from_s: float = 0.0,
    speed_mps: float = 10.0,
    rounds: bool = True,
    skip: tuple[float, float] = (np.inf, np.inf),
    speed_std_mps: float | None = None,
) -> list[ForecastOutcome]:
    """States at 10 Hz, a round each half second, complete at once."""
    found: list[ForecastOutcome] = []
    for k in range(round(from_s * 10), round(until_s * 10) + 1):
        if skip[0] < k / 10 < skip[1]:
            continue
        now = state(k / 10, speed_mps, speed_std_mps=speed_std_mps)
        found += forecasts.take_state(now, START_NS)
        if rounds and k % 5 == 0:
            told = forecasts.forecast(k, INTENT, now, (), FRAME)
            assert told is not None
            done = round_done(
                np.concatenate([straight(speed_mps=v) for v in (9.0, 11.0)]),
                round_id=k, stamp_ns=now.stamp_ns,
            )  # fmt: skip
            forecasts.take_round(done)
    return found


def fresh(horizon_s: float = 8.0) -> ProgressForecasts:
    return ProgressForecasts(progress_model(), horizon_s=horizon_s)


def test_each_instant_is_told_once_its_time_has_come() -> None:
    found = drive(fresh(), until_s=9.0)
    first = [one for one in found if one.round_id == 0]

    assert [one.horizon_s for one in first] == [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0]
    for one in first:
        assert one.travelled_m == pytest.approx(10.0 * one.horizon_s)
        assert one.p10_m < one.p50_m < one.p90_m
        assert 0.0 < one.share < 1.0
        assert one.stamp_ns == START_NS


def test_what_came_is_held_against_the_quantiles_that_were_told() -> None:
    forecasts = fresh()
    forecasts.take_state(state(0.5), START_NS)
    told = forecasts.forecast(3, INTENT, state(0.5), (), FRAME)
    assert told is not None
    forecasts.take_round(round_done(straight(), round_id=3))
    found = drive(forecasts, from_s=0.6, until_s=9.0, rounds=False)

    assert [one.horizon_s for one in found] == told.time_s.tolist()
    for k, one in enumerate(found):
        gone_m, quantiles_m = 10.0 * one.horizon_s, told.distance_m[k : k + 1]
        assert one.travelled_m == pytest.approx(gone_m)
        assert (one.p10_m, one.p50_m, one.p90_m) == pytest.approx(
            [told.at(level)[k] for level in (0.1, 0.5, 0.9)]
        )
        values = np.array([[one.travelled_m]])
        assert one.share == pytest.approx(share_below(told.levels, quantiles_m, values)[0, 0])
        assert one.crps_m == pytest.approx(crps_of(told.levels, quantiles_m, values[0])[0])
        assert (one.round_id, one.intersection_id) == (3, "n4")
        assert one.stamp_ns == START_NS + 500_000_000


def test_the_futures_alone_are_scored_as_they_spread() -> None:
    """Two futures a metre to either side of what comes: the CRPS of their quantiles is known."""
    first = drive(fresh(), until_s=9.0)[0]

    # Uniform over 2 m whose middle comes: 2/12 m, and a little for what lies beyond the outer two.
    assert first.crps_futures_m == pytest.approx(1.0 / 6.0, rel=0.01)
    assert first.crps_m == first.crps_table_m  # nothing has come yet


def test_a_round_without_valid_futures_counts_for_the_forecast_alone() -> None:
    none_valid = round_done(straight(speed_mps=9.0), outcome={"valid": np.array([False])})
    for done in (none_valid, replace(none_valid, results=())):
        forecasts = fresh()
        forecasts.take_state(state(0.0), START_NS)
        forecasts.forecast(0, INTENT, state(0.0), (), FRAME)
        forecasts.take_round(done)
        (first,) = forecasts.take_state(state(1.0), START_NS)

        assert first.travelled_m == pytest.approx(10.0)
        assert first.crps_m < 5.0
        assert first.crps_futures_m is None


def test_what_came_narrows_the_band_of_a_steady_driver() -> None:
    found = drive(fresh(), until_s=180.0)
    early = [one for one in found if one.horizon_s == 4.0][:5]
    late = [one for one in found if one.horizon_s == 4.0][-5:]

    assert late[-1].p90_m - late[-1].p10_m < 0.5 * (early[0].p90_m - early[0].p10_m)
    assert late[-1].crps_m < 0.5 * late[-1].crps_table_m
    assert late[-1].p50_m == pytest.approx(40.0, abs=1.0)


def test_cutting_the_drive_changes_nothing_before_the_cut() -> None:
    assert drive(fresh(), until_s=12.0) == [
        one for one in drive(fresh(), until_s=20.0) if one.stamp_ns + one.horizon_s * 1e9
        <= START_NS + 12e9
    ]  # fmt: skip


def test_a_standing_car_has_a_forecast_that_does_not_count() -> None:
    forecasts = fresh()
    assert drive(forecasts, until_s=12.0, speed_mps=0.2) == []


def test_a_car_that_is_unsure_of_its_speed_is_told_a_wider_band_and_calibrates_alike() -> None:
    sure, unsure = fresh(), fresh()
    found = drive(sure, until_s=30.0), drive(unsure, until_s=30.0, speed_std_mps=1.0)
    told = [
        one.forecast(999, INTENT, state(30.0, speed_std_mps=std_mps), (), FRAME)
        for one, std_mps in ((sure, None), (unsure, 1.0))
    ]

    assert told[0] is not None
    assert told[1] is not None
    width = [float((one.at(0.9) - one.at(0.1))[0]) for one in told if one is not None]
    assert width[1] > 2.0 * width[0]
    assert found[0] == found[1]


def test_before_any_motion_there_is_no_forecast() -> None:
    assert fresh().forecast(0, INTENT, state(0.0), (), FRAME) is None


def test_nothing_is_told_across_a_hole() -> None:
    found = drive(fresh(), until_s=9.0, skip=(3.0, 6.5))

    assert max(one.stamp_ns + round(one.horizon_s * 1e9) for one in found) <= START_NS + 9e9
    assert not [one for one in found if one.round_id == 0 and one.horizon_s > 3.0]


def test_a_short_future_is_told_of_its_own_instants() -> None:
    assert {one.horizon_s for one in drive(fresh(4.0), until_s=9.0)} == {1.0, 2.0, 3.0, 4.0}


def test_a_round_that_never_completes_does_not_count() -> None:
    forecasts = fresh()
    forecasts.take_state(state(0.0), START_NS)
    forecasts.forecast(0, INTENT, state(0.0), (), FRAME)

    assert drive(forecasts, from_s=0.1, until_s=9.0, rounds=False) == []


def test_two_rounds_of_one_state_are_no_more_evidence_than_one() -> None:
    """A receiver of 1 Hz gives rounds of 2 Hz one state in two."""
    once, twice = fresh(), fresh()
    for forecasts, rounds in ((once, 1), (twice, 2)):
        forecasts.take_state(state(0.0), START_NS)
        for round_id in range(rounds):
            forecasts.forecast(round_id, INTENT, state(0.0), (), FRAME)
            forecasts.take_round(round_done(straight(), round_id=round_id))
    found = [drive(one, from_s=0.1, until_s=9.0, rounds=False) for one in (once, twice)]

    assert len(found[0]) == 8
    assert found[1] == found[0]


def test_another_orchestrator_goes_on_with_what_was_learnt() -> None:
    one, other = fresh(), fresh()
    drive(one, until_s=60.0)
    history, calibration = pickle.loads(pickle.dumps((one.history, one.calibration)))
    other.go_on(history, calibration)
    told = [forecasts.forecast(999, INTENT, state(60.0), (), FRAME) for forecasts in (one, other)]

    assert told[0] is not None
    assert told[1] is not None
    assert told[0].distance_m.tobytes() == told[1].distance_m.tobytes()


def test_the_same_rounds_give_the_same_bits_and_a_copy_goes_on_alike() -> None:
    one = fresh()
    drive(one, until_s=15.0)
    other = copy.deepcopy(one)

    assert drive(one, from_s=15.1, until_s=30.0) == drive(other, from_s=15.1, until_s=30.0)


def test_a_round_that_completes_after_a_hole_does_not_count() -> None:
    forecasts = fresh()
    for k in range(30):
        forecasts.take_state(state(k / 10), START_NS)
    assert forecasts.forecast(7, INTENT, state(2.9), (), FRAME) is not None
    forecasts.take_state(state(10.0), START_NS)
    assert forecasts.forecast(8, INTENT, state(10.0), (), FRAME) is not None
    for round_id in (7, 8):
        forecasts.take_round(round_done(straight(), round_id=round_id))
    found = drive(forecasts, from_s=10.1, until_s=20.0, rounds=False)

    assert [one.round_id for one in found] == [8] * 8


def test_an_arrival_is_told_from_where_the_car_is_now() -> None:
    forecasts = fresh()
    drive(forecasts, until_s=20.0)
    then = forecasts.arrival_band(60.0, usual_mps=10.0)
    forecasts.take_state(state(20.4), START_NS)
    now = forecasts.arrival_band(56.0, usual_mps=10.0)

    assert then is not None
    assert now is not None
    assert then.late_s is not None
    assert then.early_s < 6.0 < then.late_s
    assert now.early_s == pytest.approx(then.early_s - 0.4)
    assert now.late_s == pytest.approx(then.late_s - 0.4)


def test_without_a_round_of_late_no_arrival_is_told() -> None:
    forecasts = fresh()
    assert forecasts.arrival_band(60.0, usual_mps=10.0) is None
    drive(forecasts, until_s=1.0, rounds=False)
    assert forecasts.arrival_band(60.0, usual_mps=10.0) is None
    drive(forecasts, until_s=5.0)
    drive(forecasts, from_s=5.1, until_s=8.0, rounds=False)
    assert forecasts.arrival_band(60.0, usual_mps=10.0) is None


def test_a_forecast_from_before_a_hole_tells_no_arrival() -> None:
    forecasts = fresh()
    drive(forecasts, until_s=5.0)
    forecasts.take_state(state(4.0), START_NS)  # the clock stepped back
    assert forecasts.arrival_band(60.0, usual_mps=10.0) is None


def test_where_no_junction_is_ahead_none_is_forecast_for() -> None:
    forecasts = fresh()
    drive(forecasts, until_s=3.0, rounds=False)
    here = state(3.0)
    nowhere = replace(INTENT, next_junction=None)
    facts = [_ahead(intent, here, (), FRAME) for intent in (INTENT, nowhere)]
    assert facts[0] == facts[1]._replace(junction_m=80, control=float(CONTROLS.index("signals")))
    assert forecasts.forecast(1, nowhere, here, (), FRAME) is not None
