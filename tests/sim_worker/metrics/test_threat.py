"""Threat numbers, last moments and safe distances behind a leader, against their closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from foretwin.sim_worker.driver_model import MAX_DECEL_MPS2
from foretwin.sim_worker.metrics.evaluation import evaluate
from foretwin.sim_worker.metrics.threat import MAX_LATERAL_MPS2
from tests.sim_worker.metrics.motions import LENGTH_M, WIDTH_M, Mover, rollout, times

NAMES = ("btn", "stn", "ttb", "tts", "ttr", "rss_distance", "rss_margin")
speeds = st.floats(2.0, 25.0)


def measured(ego: Mover, *others: Mover) -> dict[str, float]:
    found = evaluate(rollout(ego, *others, time_s=times(0.1)), NAMES)
    return {name: float(one.values[0]) for name, one in found.items()}


@settings(max_examples=80)
@example(2.0, 2.0, 20.0, 0.0, 1.0)  # as fast as the leader, but for rounding
@example(2.01, 2.0, 20.0, 0.0, 1.0)
@given(speeds, speeds, st.floats(20.0, 60.0), st.floats(-0.8, 0.8), st.floats(-3.1, 3.1))
def test_behind_a_leader_in_any_direction(
    speed: float, leader_mps: float, ahead: float, aside: float, yaw: float
) -> None:
    cos, sin = math.cos(yaw), math.sin(yaw)
    x, y = cos * ahead - sin * aside, sin * ahead + cos * aside

    found = measured(Mover(0, 0, yaw, speed), Mover(x, y, yaw, leader_mps, 5.0, 1.9))

    closing = speed - leader_mps
    gap = ahead - LENGTH_M / 2 - 2.5
    nearest = gap - max(0.1 * closing, 0.0)
    reached = speed + 3.5
    safe = (speed + reached) / 2.0 + reached**2 / 8.0 - leader_mps**2 / 16.0
    assert found["rss_distance"] == pytest.approx(max(safe, 0.0), abs=1e-6)
    assert found["rss_margin"] == pytest.approx(nearest - max(safe, 0.0), abs=1e-6)
    if closing <= 0.0:
        assert found["btn"] == pytest.approx(0.0, abs=1e-6)
        assert found["ttb"] == found["tts"] == found["ttr"] == math.inf
    elif closing > 1e-3:
        until = nearest / closing
        way = (WIDTH_M + 1.9) / 2 - abs(aside)
        brake = until - closing / (2.0 * MAX_DECEL_MPS2)
        steer = until - math.sqrt(2.0 * way / MAX_LATERAL_MPS2)
        assert found["btn"] == pytest.approx(closing**2 / (2 * nearest) / MAX_DECEL_MPS2, abs=1e-6)
        assert found["stn"] == pytest.approx(2 * way / until**2 / MAX_LATERAL_MPS2, rel=1e-6)
        assert found["ttb"] == pytest.approx(brake, abs=1e-6, rel=1e-6)
        assert found["tts"] == pytest.approx(steer, abs=1e-6, rel=1e-6)
        assert found["ttr"] == pytest.approx(max(brake, steer), abs=1e-6, rel=1e-6)


def test_at_the_last_moment_full_brakes_just_suffice() -> None:
    """15 m/s towards a wall: 225 / 16 m to stop in, and not 10 cm less."""
    stop_m = 15.0**2 / (2.0 * MAX_DECEL_MPS2) + LENGTH_M / 2 + 2.0
    late = measured(Mover(0, 0, 0, 15), Mover(stop_m + 1.4, 0, 0, 0))
    later = measured(Mover(0, 0, 0, 15), Mover(stop_m + 1.6, 0, 0, 0))

    assert late["ttb"] < 0.0 < later["ttb"]
    assert later["btn"] < 1.0 < late["btn"]


def test_of_several_leaders_the_worst_counts() -> None:
    near, fast = Mover(30, 0, 0, 9.5), Mover(45, 0, 0, 2)
    both = measured(Mover(0, 0, 0, 10), near, fast)

    alone = measured(Mover(0, 0, 0, 10), near), measured(Mover(0, 0, 0, 10), fast)
    for name in ("btn", "stn", "rss_distance"):
        assert both[name] == max(one[name] for one in alone)
    for name in ("ttb", "tts", "ttr", "rss_margin"):
        assert both[name] == min(one[name] for one in alone)


def test_without_a_leader_nothing_threatens() -> None:
    alone = measured(Mover(0, 0, 0, 10))
    crossing = measured(Mover(0, 0, 0, 10), Mover(30, -2, math.pi / 2, 4))

    for found in (alone, crossing):
        assert found["btn"] == found["stn"] == found["rss_distance"] == 0.0
        assert all(found[name] == math.inf for name in ("ttb", "tts", "ttr", "rss_margin"))


@settings(max_examples=40)
@given(st.floats(-3.1, 3.1), st.floats(0.0, 25.0))
@example(0.0, 10.0)
def test_who_is_not_there_is_never_ahead(yaw: float, speed: float) -> None:
    drawn = rollout(Mover(0, 0, yaw, speed), Mover(30.0, 0.0), time_s=times(2.0))
    alone = drawn._replace(
        users=np.full_like(drawn.users, np.nan),
        user_speed_mps=np.full_like(drawn.user_speed_mps, np.nan),
    )

    found = evaluate(alone, ("thw", "ttc", "wttc", "ttb", "tts", "rss_margin", "drac"))

    values = {name: float(one.values[0]) for name, one in found.items()}
    assert values.pop("drac") == 0.0
    assert set(values.values()) == {math.inf}


def test_of_a_crash_the_last_instant_before_the_touch_counts() -> None:
    """15 m/s into 5 m/s, 30.5 m ahead: they meet after 3.05 s, and 0.5 m are left at 3 s."""
    names = ("drac", "required_deceleration", "btn", "stn", "required_acceleration")
    ahead = LENGTH_M / 2 + 30.5 + 2.0
    crash = rollout(Mover(0, 0, 0, 15), Mover(ahead, 0, 0, 5), time_s=times(8.0))
    found = evaluate(crash._replace(last=np.array([32])), names)

    assert found["drac"].values == pytest.approx([100.0])
    assert found["required_deceleration"].values == pytest.approx([100.0])
    assert found["btn"].values == pytest.approx([100.0 / MAX_DECEL_MPS2])
    aside = (WIDTH_M + 2.0) / 2.0
    assert found["stn"].values == pytest.approx([2.0 * aside / 0.05**2 / MAX_LATERAL_MPS2])
    assert np.isfinite(found["required_acceleration"].values).all()


def test_of_whom_it_nears_only_once_they_touch_nothing_is_said() -> None:
    inside = Mover(LENGTH_M / 2 + 1.0, 0, 0, 5)
    found = evaluate(rollout(Mover(0, 0, 0, 15), inside, time_s=times(0.1)), ("drac", "btn", "stn"))

    for measure in found.values():
        assert not measure.valid.any()
        assert np.isnan(measure.values).all()
