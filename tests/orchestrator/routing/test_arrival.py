from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.orchestrator.routing.arrival import (
    DWELL_S,
    EASING_S,
    USUAL_SHARE,
    DrivingPace,
    predict_arrivals,
)
from foretwin.orchestrator.routing.junctions_ahead import UpcomingJunction
from foretwin.orchestrator.routing.route import Route
from foretwin.world_gen.roads.road_graph import DirectedEdge
from tests.orchestrator.grid_map import grid, junctions

TOWN = grid(12, 2)
ROUTE = Route(tuple(DirectedEdge(TOWN.edges[index], False) for index in range(11)))
LIMIT_MPS = 50 / 3.6


def pace_at(speed_mps: float, *, seconds: int = 0) -> DrivingPace:
    pace = DrivingPace()
    for tenth in range(10 * seconds + 1):
        pace.update(tenth * 100_000_000, speed_mps, LIMIT_MPS)
    return pace


def test_at_the_usual_speed_arrival_is_distance_over_speed() -> None:
    usual = USUAL_SHARE * LIMIT_MPS

    assert pace_at(usual).seconds_for(ROUTE, 100.0, 400.0) == pytest.approx(300.0 / usual, rel=1e-3)


def test_a_driver_who_is_slower_than_usual_arrives_later() -> None:
    slow = pace_at(5.0, seconds=200)

    assert slow.share == pytest.approx(5.0 / LIMIT_MPS, abs=0.01)
    assert slow.seconds_for(ROUTE, 0.0, 500.0) == pytest.approx(100.0, rel=0.02)


def test_a_standing_car_waits_and_sets_off() -> None:
    usual = USUAL_SHARE * LIMIT_MPS
    expected = DWELL_S + EASING_S + 600.0 / usual

    assert pace_at(0.0).seconds_for(ROUTE, 0.0, 600.0) == pytest.approx(expected, abs=0.01)


def test_standing_teaches_nothing_about_the_pace() -> None:
    assert pace_at(0.0, seconds=120).share == USUAL_SHARE


@given(speed=st.floats(0.0, 30.0), near=st.floats(1.0, 500.0), more=st.floats(1.0, 500.0))
def test_farther_is_later_and_never_negative(speed: float, near: float, more: float) -> None:
    pace = pace_at(speed)

    assert 0.0 < pace.seconds_for(ROUTE, 0.0, near) < pace.seconds_for(ROUTE, 0.0, near + more)


def test_arrivals_name_the_junctions_in_order() -> None:
    ahead = [
        UpcomingJunction(junction, 100.0 * number)
        for number, junction in enumerate(junctions(TOWN)[:3], start=1)
    ]
    arrivals = predict_arrivals(ROUTE, 0.0, ahead, pace_at(8.0))

    assert [arrival.junction for arrival in arrivals] == [a.junction for a in ahead]
    assert sorted(a.in_s for a in arrivals) == [a.in_s for a in arrivals]
