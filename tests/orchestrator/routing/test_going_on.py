"""One law of how a driver goes on, for futures and for arrivals."""

from __future__ import annotations

import math

import pytest

from foretwin.orchestrator.routing.going_on import going_on_mps2, stands


def accel(
    speed_mps: float,
    present_mps2: float = 0.0,
    *,
    present: float = 0.5,
    wanted_mps: float = math.inf,
    bend_mps: float = math.inf,
) -> float:
    return going_on_mps2(
        speed_mps, present_mps2, present, wanted_mps=wanted_mps, within_s=10.0, bend_mps=bend_mps
    )


def test_what_is_left_of_now_counts_and_the_rest_is_what_is_wanted() -> None:
    assert accel(8.0, 1.0, present=1.0, wanted_mps=12.0) == 1.0
    assert accel(8.0, 1.0, present=0.0, wanted_mps=12.0) == pytest.approx(0.4)
    assert accel(8.0, 1.0, wanted_mps=12.0) == pytest.approx(0.7)


def test_where_nothing_is_wanted_what_is_left_of_now_counts() -> None:
    assert accel(8.0, -1.0) == pytest.approx(-0.5)


def test_a_bend_is_braked_for_and_never_pushes() -> None:
    assert accel(8.0, bend_mps=7.0) == pytest.approx(-2.0)
    assert accel(8.0, bend_mps=20.0) == 0.0
    assert accel(30.0, bend_mps=1.0) == -8.0


def test_a_car_that_pulls_away_does_not_stand() -> None:
    assert stands(0.2, 0.1)
    assert not stands(0.2, 0.3)
    assert not stands(0.6, 0.0)
