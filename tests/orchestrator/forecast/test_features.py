"""What a forecast is made from."""

from __future__ import annotations

import numpy as np
import pytest

from foretwin.contracts.futures import SeenRoadUser
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.orchestrator.forecast.features import (
    CURVE_ACCEL_MPS2,
    FASTEST_MPS,
    FEATURES,
    AheadFacts,
    bends_ahead,
    feature_row,
    lead_on,
)
from foretwin.orchestrator.forecast.motion_history import MotionHistory

STRAIGHT = FrenetPath(np.column_stack([np.arange(200.0), np.zeros(200)]), np.full(200, 13.9))


def corner(after_m: float, radius_m: float) -> FrenetPath:
    """Straight on, then a quarter of a circle to the left."""
    turn = np.linspace(0.0, np.pi / 2.0, 30)
    bend = np.column_stack([after_m + radius_m * np.sin(turn), radius_m * (1.0 - np.cos(turn))])
    return FrenetPath(np.concatenate([np.column_stack([[0.0], [0.0]]), bend]))


def user(x_m: float, y_m: float, speed_mps: float, *, yaw_rad: float = 0.0) -> SeenRoadUser:
    return SeenRoadUser(
        kind="car", x_m=x_m, y_m=y_m, yaw_rad=yaw_rad, speed_mps=speed_mps, length_m=4.5,
        width_m=1.8,
    )  # fmt: skip


def test_a_straight_has_no_bends_and_its_limit() -> None:
    facts = bends_ahead(STRAIGHT, 20.0)

    assert facts.bend_mps == pytest.approx((FASTEST_MPS,) * 4)
    assert (facts.ease_mps, facts.limit_mps) == pytest.approx((FASTEST_MPS, 13.9))


def test_a_bend_slows_down_from_where_it_is_within_reach() -> None:
    facts = bends_ahead(corner(40.0, 12.5), 0.0)
    bend_mps = np.sqrt(CURVE_ACCEL_MPS2 * 12.5)

    assert facts.bend_mps[:2] == pytest.approx((FASTEST_MPS, FASTEST_MPS))
    assert facts.bend_mps[2:] == pytest.approx((bend_mps, bend_mps), rel=0.1)
    # v² = v_bend² + 2 a s: eased from 38 m before it.
    assert facts.ease_mps == pytest.approx(np.sqrt(bend_mps**2 + 2.0 * 1.5 * 39.0), rel=0.1)
    assert np.isnan(facts.limit_mps)


def test_the_lead_is_who_is_nearest_ahead_on_the_path() -> None:
    users = (user(90.0, 0.5, 8.0), user(60.0, 0.0, 5.0), user(40.0, 3.0, 1.0), user(10.0, 0.0, 9.0))

    assert lead_on(STRAIGHT, 20.0, users) == pytest.approx((40.0, 5.0))
    assert lead_on(STRAIGHT, 95.0, users) == pytest.approx((np.nan, np.nan), nan_ok=True)
    assert lead_on(STRAIGHT, 20.0, ()) == pytest.approx((np.nan, np.nan), nan_ok=True)


def test_who_comes_the_other_way_has_a_negative_speed() -> None:
    gap, speed = lead_on(STRAIGHT, 0.0, (user(50.0, 0.0, 7.0, yaw_rad=np.pi),))

    assert (gap, speed) == pytest.approx((50.0, -7.0))


def test_a_row_has_a_number_or_none_for_each_name() -> None:
    history = MotionHistory()
    for k in range(31):
        history.take(k * 100_000_000, 5.0 + 0.1 * k)
    row = feature_row(history, accel_mps2=1.0, yaw_rate_radps=-0.1, ahead=AheadFacts())
    told = dict(zip(FEATURES, row.tolist(), strict=True))

    assert told["speed_mps"] == pytest.approx(8.0)
    assert told["speed_gain_2s_mps"] == pytest.approx(2.0)
    assert np.isnan(told["speed_gain_4s_mps"])
    assert told["speed_most_10s_mps"] == pytest.approx(8.0)
    assert told["lateral_accel_mps2"] == pytest.approx(0.8)
    assert np.isnan(told["junction_m"])
