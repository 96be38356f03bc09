"""Places of drives that are known: at 10 m/s for 40 s, then standing, then going on."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.trust.places_ahead import (
    AHEAD_M,
    LATER_S,
    Moment,
    Told,
    WayDriven,
    places,
    what_came,
)

TIME_S = np.arange(0.0, 100.0, 0.1)
SPEED_MPS = np.where((TIME_S > 40.0) & (TIME_S < 50.0), 0.0, 10.0)
WAY_M = np.concatenate([[0.0], np.cumsum(0.05 * (SPEED_MPS[1:] + SPEED_MPS[:-1]))])
DRIVEN = WayDriven(TIME_S, WAY_M, SPEED_MPS)


def moment(time_s: float, *told: Told, law_mps: float = 10.0) -> Moment:
    """What a car at 10 m/s knows that the law has at another speed."""
    return Moment(
        time_s, 10.0, 0.0, 12.0, 13.9, AHEAD_M / law_mps, np.full(200, 15.0), np.ones((8, 19)), told
    )


def test_places_are_where_the_car_came_to() -> None:
    found = places(moment(10.0, law_mps=12.5), DRIVEN)

    assert [one.later_s for one in found] == list(LATER_S)
    assert [one.law_s for one in found] == pytest.approx([0.8 * t for t in LATER_S], rel=1e-6)
    assert {one.least_mps for one in found} == {10.0}
    assert [one.known[0] for one in found] == pytest.approx([10.0 * t for t in LATER_S])


def test_no_place_lies_behind_a_stop() -> None:
    assert [one.later_s for one in places(moment(33.0), DRIVEN)] == [3.0, 4.5, 6.0]


def test_no_place_lies_behind_a_gap_or_the_end() -> None:
    kept = (TIME_S < 20.0) | (TIME_S > 23.0)
    torn = WayDriven(*(column[kept] for column in DRIVEN))

    assert [one.later_s for one in places(moment(13.0), torn)] == [3.0, 4.5, 6.0]
    assert [one.later_s for one in places(moment(94.0), DRIVEN)] == [3.0, 4.5]


def test_what_is_told_may_come_after_a_stop() -> None:
    short, long = Told(5.0, 50.0, 4.0, 8.0), Told(10.0, 100.0, 8.0, math.inf)
    came = what_came(moment(35.5, short, long), DRIVEN)

    assert [one.told for one in came] == [short, long]
    assert [one.came_s for one in came] == pytest.approx([15.0, 20.0], abs=0.2)
    assert what_came(moment(95.0, short, long), DRIVEN) == []
