"""Reference drivers of UN Regulation No. 157, against numbers worked out by hand from its text."""

from __future__ import annotations

import numpy as np
import pytest

from foretwin.sim_worker.analysis.occurred.driver_models import (
    Ahead,
    careful_driver,
    critical_safety,
    fuzzy_driver,
    proactive_safety,
)

ROWS = 120


def in_lane(gap_m: float, speed_mps: float = 0.0) -> Ahead:
    """Somebody on the course all the time, so far ahead of a car whose front is at 0."""
    time_s = np.arange(ROWS) * 0.1
    return Ahead(
        gap_m + speed_mps * time_s,
        np.full(ROWS, speed_mps),
        np.full(ROWS, -1.0),
        np.zeros(ROWS),
        9.0,
    )


def cutting_in(dist_m: float, other_kmh: float, aside_mps: float) -> Ahead:
    """Somebody 1.6 m beside who comes at a sideways speed, with the boxes of JRC-FSM."""
    time_s = np.arange(200) * 0.1
    beside = np.maximum(3.5 - aside_mps * time_s, 0.0) - 1.9
    comes = np.where(beside > -1.9, aside_mps, 0.0)
    speed = other_kmh / 3.6
    return Ahead(dist_m + speed * time_s, np.full(200, speed), beside, comes, 8.6)


@pytest.mark.parametrize(("gap_m", "touches"), [(54.5, True), (56.0, False)])
def test_the_careful_driver_stops_from_20_mps_in_55_m(gap_m: float, touches: bool) -> None:
    # 0.4 s + 0.75 s at 20 m/s are 23 m; 0.6 s until 7.59 m/s² 11.5 m; from 17.7 m/s on 20.7 m.
    played = careful_driver(in_lane(gap_m), front_m=0.0, speed_mps=20.0, perceived_row=0)

    assert played.collided is touches
    assert played.least_gap_m == pytest.approx(0.0 if touches else 0.8, abs=0.3)


def test_who_perceives_later_needs_more() -> None:
    ahead = in_lane(60.0)

    assert not careful_driver(ahead, front_m=0.0, speed_mps=20.0, perceived_row=0).collided
    assert careful_driver(ahead, front_m=0.0, speed_mps=20.0, perceived_row=4).collided


def test_fuzzy_safety_lies_between_what_is_safe_and_what_is_not() -> None:
    # 20 m/s towards somebody who stands: safe from 15 + 50 + 2 m, unsafe below 15 + 33.3 m, of
    # what is left beyond 2 m. 20 m/s behind 10 m/s: 7.5 + 12.5 m and 7.5 + 8.3 m.
    assert proactive_safety(60.0, 20.0, 0.0) == pytest.approx((67.0 - 58.0) / (67.0 - 48.333), 1e-3)
    assert critical_safety(18.0, 20.0, 10.0, 0.0) == pytest.approx(2.0 / 4.1667, 1e-3)
    assert proactive_safety(70.0, 20.0, 0.0) == critical_safety(21.0, 20.0, 10.0, 0.0) == 0.0
    assert proactive_safety(45.0, 20.0, 0.0) == critical_safety(15.0, 20.0, 10.0, 0.0) == 1.0
    assert critical_safety(1.0, 10.0, 10.0, 0.0) == 0.0


def test_whoever_brakes_already_is_safe_sooner() -> None:
    # At -4 m/s² both are as fast after 0.5 s, within the reaction time: 2² / 8 m are what it takes.
    assert critical_safety(0.6, 12.0, 10.0, -4.0) == 0.0
    assert critical_safety(0.4, 12.0, 10.0, -4.0) == 1.0


@pytest.mark.parametrize(
    ("ego_kmh", "other_kmh", "aside_mps", "touched_m"),
    [
        (50, 10, 1.0, {14, 20}),
        (60, 30, 1.5, {2, 8, 14}),
        (90, 30, 1.0, {20, 26, 32, 38}),
    ],
)
def test_the_fuzzy_driver_is_that_of_the_joint_research_centre(
    ego_kmh: float, other_kmh: float, aside_mps: float, touched_m: set[int]
) -> None:
    """Distances at which the fuzzy model of JRC-FSM touches, as that program says when run."""
    found = {
        dist
        for dist in range(2, 60, 6)
        if fuzzy_driver(
            cutting_in(dist, other_kmh, aside_mps), front_m=0.0, speed_mps=ego_kmh / 3.6
        ).collided
    }

    assert found == touched_m


def test_the_fuzzy_driver_lets_alone_who_comes_behind_it() -> None:
    ahead = cutting_in(-3.0, 20.0, 0.4)

    assert not fuzzy_driver(ahead, front_m=0.0, speed_mps=14.0).collided
