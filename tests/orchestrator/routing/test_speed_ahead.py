"""What the nominal future is to drive: the present acceleration, fading into the usual speed."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.contracts.futures import PathAhead
from foretwin.orchestrator.routing.going_on import FADING_S, USUAL_S
from foretwin.orchestrator.routing.speed_ahead import (
    MOST_BEND_MPS2,
    USUAL_BEND_MPS2,
    bend_accel_mps2,
    speeds_ahead,
    way_speeds,
)

STRAIGHT = np.column_stack([np.arange(-10.0, 301.0), np.zeros(311)])


def ahead(
    speed_mps: float,
    accel_mps2: float = 0.0,
    *,
    limit_mps: float = 14.0,
    usual_share: float | None = None,
    xy_m: np.ndarray = STRAIGHT,
    horizon_s: float = 8.0,
) -> np.ndarray:
    """The speeds of a driver whose usual one is the present, unless a share of the limit is."""
    path = PathAhead(xy_m=xy_m, speed_limit_mps=np.full(len(xy_m), limit_mps))
    return speeds_ahead(
        way_speeds(path, speed_mps=speed_mps),
        speed_mps=speed_mps,
        acceleration_mps2=accel_mps2,
        usual_share=speed_mps / limit_mps if usual_share is None else usual_share,
        horizon_s=horizon_s,
    )


def test_a_steady_driver_goes_on_as_usual() -> None:
    np.testing.assert_allclose(ahead(9.0), 9.0)
    assert len(ahead(9.0)) == 17
    assert len(ahead(9.0, horizon_s=2.2)) == 6


@given(accel=st.floats(-2.0, 2.0))
def test_an_acceleration_fades(accel: float) -> None:
    speeds = ahead(8.0, accel, limit_mps=1e3)
    faded = 8.0 + accel * FADING_S * (1.0 - math.exp(-1.0 / FADING_S))

    assert speeds[0] == 8.0
    assert speeds[2] == pytest.approx(faded, abs=0.02)
    assert abs(speeds[16] - 8.0) <= abs(accel) * FADING_S


def test_a_driver_comes_back_to_the_usual_speed_slowly() -> None:
    speeds = ahead(5.0, usual_share=0.75)

    assert (np.diff(speeds) > 0.0).all()
    assert speeds[-1] < 5.0 + 8.0 * (0.75 * 14.0 - 5.0) / USUAL_S


def test_nobody_is_thought_to_exceed_the_limit_more_than_now() -> None:
    assert ahead(13.0, 2.0).max() == 14.0
    assert ahead(17.0, 2.0).max() == 17.0


def test_without_a_limit_the_speed_is_what_acceleration_makes_of_it() -> None:
    speeds = ahead(8.0, 1.0, limit_mps=math.inf, usual_share=0.75)

    assert speeds[-1] == pytest.approx(8.0 + FADING_S * (1.0 - math.exp(-8.0 / FADING_S)), abs=0.03)


def test_a_standing_car_stands_until_it_pulls_away() -> None:
    np.testing.assert_array_equal(ahead(0.0, 0.1), 0.0)
    assert ahead(0.4)[1:].max() == 0.0
    assert ahead(0.3, 1.0)[-1] > 2.0


def test_a_braking_car_comes_to_a_stop_and_does_not_go_back() -> None:
    speeds = ahead(3.0, -2.0)

    assert speeds.min() == 0.0


def test_bends_ahead_are_braked_for() -> None:
    turn = np.linspace(0.0, math.pi / 2.0, 16)
    arc = np.column_stack([40.0 + 10.0 * np.sin(turn), 10.0 - 10.0 * np.cos(turn)])
    rest = np.column_stack([np.full(100, 50.0), np.arange(11.0, 111.0)])
    speeds = ahead(10.0, xy_m=np.concatenate([STRAIGHT[:50], arc, rest]))

    assert speeds[2] == pytest.approx(10.0, abs=0.2)
    assert speeds.min() == pytest.approx(math.sqrt(USUAL_BEND_MPS2 * 10.0), abs=0.6)
    assert speeds.argmin() in range(9, 15)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_who_comes_to_a_bend_faster_than_usual_takes_it_faster(side: float) -> None:
    bend = np.where(np.arange(100) >= 20, side * 0.05, 0.0)

    # 20 m before it, comfortable braking takes 80 m²/s² off the square of the speed.
    assert bend_accel_mps2(bend, math.sqrt(80.0 + 20.0 * 3.0)) == pytest.approx(3.0)
    assert bend_accel_mps2(bend, 10.0) == USUAL_BEND_MPS2
    assert bend_accel_mps2(bend, 20.0) == MOST_BEND_MPS2
    assert bend_accel_mps2(bend[20:], 8.0) == pytest.approx(3.2)
    assert bend_accel_mps2(np.zeros(0), 8.0) == USUAL_BEND_MPS2


def test_in_a_bend_that_is_driven_faster_than_usual_nobody_brakes_at_once() -> None:
    turned = np.linspace(-0.4, 2.5, 120)
    circle = 40.0 * np.column_stack([np.sin(turned), -np.cos(turned)])
    path = PathAhead(xy_m=circle, speed_limit_mps=np.full(120, 14.0))
    way = way_speeds(path, speed_mps=11.0)

    assert way.bend_accel_mps2 == pytest.approx(11.0**2 / 40.0, rel=0.02)
    assert ahead(11.0, xy_m=circle)[:9].min() > 10.8
    assert way_speeds(path, speed_mps=8.0).bend_accel_mps2 == USUAL_BEND_MPS2


def test_what_was_driven_before_is_come_back_to_sooner_than_what_is_usual() -> None:
    path = PathAhead(xy_m=STRAIGHT, speed_limit_mps=np.full(len(STRAIGHT), 14.0))

    def to(driven_mps: np.ndarray | None) -> np.ndarray:
        return speeds_ahead(
            way_speeds(path, driven_mps, speed_mps=8.0), speed_mps=8.0, acceleration_mps2=0.0,
            usual_share=12.0 / 14.0, horizon_s=8.0,
        )  # fmt: skip

    before = to(np.full(len(STRAIGHT), 12.0))
    assert before[-1] > to(None)[-1] + 1.0
    assert before[2] == pytest.approx(to(None)[2], abs=0.15)
    np.testing.assert_array_equal(to(np.full(len(STRAIGHT), np.nan)), to(None))
    slow_from_50_m = to(np.where(STRAIGHT[:, 0] < 50.0, np.nan, 4.0))
    assert slow_from_50_m.max() > 8.0
    assert slow_from_50_m[-1] < 8.0
