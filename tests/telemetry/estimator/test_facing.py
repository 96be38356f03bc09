"""Which way a car faces where positions alone tell: what no car can do is not motion."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.contracts.drive import HeadingSample
from foretwin.geometry.steering import MAX_CURVATURE_PM
from foretwin.telemetry.estimator.estimator import StateEstimator
from foretwin.telemetry.estimator.facing import Facing
from foretwin.telemetry.estimator.kinematic_filter import KinematicFilter
from foretwin.telemetry.estimator.position_gate import PositionGate
from tests.telemetry.position_track import along, circle, fix, info, states_of, xy, yaw


def stepped(
    to_xy_m: tuple[float, float], *, yaw_std_rad: float = 0.03, yaw_rad: float = 0.0
) -> Facing:
    """A car that faces so at the origin, and a fix a second later."""
    gate = PositionGate()
    facing = Facing(gate)
    gate.judge(0.0, np.zeros(2), None)
    filter_ = KinematicFilter(
        xy_m=np.zeros(2), yaw_rad=yaw_rad, speed_mps=2.0, yaw_std_rad=yaw_std_rad
    )
    facing.take(filter_)
    gate.judge(1.0, np.array(to_xy_m), None)
    return facing


@given(
    curvature=st.floats(-MAX_CURVATURE_PM, MAX_CURVATURE_PM),
    way_m=st.floats(-6.0, 6.0),
    yaw_rad=st.floats(-3.0, 3.0),
)
def test_no_bend_that_a_car_can_drive_forwards_or_backwards_goes_sideways(
    curvature: float, way_m: float, yaw_rad: float
) -> None:
    turned = curvature * way_m
    chord_m = way_m * float(np.sinc(turned / math.tau))
    at = yaw_rad + 0.5 * turned
    end = chord_m * math.cos(at), chord_m * math.sin(at)
    assert not stepped(end, yaw_rad=yaw_rad).goes_sideways(0.01)


@pytest.mark.parametrize("to_xy_m", [(0.4, 0.2), (-0.9, -0.8), (0.0, 0.3)])
def test_a_short_step_across_the_car_is_the_receivers(to_xy_m: tuple[float, float]) -> None:
    assert stepped(to_xy_m).goes_sideways(0.012)
    assert not stepped(to_xy_m, yaw_std_rad=0.5).goes_sideways(0.012), "who knows how it faces"
    assert not stepped(to_xy_m).goes_sideways(0.3), "noise may do that"


def test_a_slip_across_a_car_that_stands_does_not_turn_it_at_one_fix_a_second() -> None:
    def place(time_s: float) -> tuple[float, float]:
        t = min(time_s, 8.0)
        slip = (-0.9, -0.8) if time_s > 12.5 else (0.0, 0.0)
        return 8.0 * t - 0.5 * t * t + slip[0], slip[1]

    states = states_of(along(place, 20.0, rate_hz=1.0))
    assert abs(yaw(states[-1])) < 0.1
    assert states[-1].speed_mps == pytest.approx(0.0, abs=0.1)
    assert xy(states[-1]) == pytest.approx(place(20.0), abs=0.05)


def test_a_slip_across_a_car_that_pulls_away_does_not_turn_it() -> None:
    def place(time_s: float) -> tuple[float, float]:
        x = 2.0 * min(time_s, 6.0)
        t = max(0.0, time_s - 9.0)
        return x + 0.75 * t * t, 0.17 if time_s > 9.7 else 0.0

    for state in states_of(along(place, 14.0, rate_hz=4.0))[8:]:
        assert abs(yaw(state)) < 0.15, state.stamp_ns


def pulling_away(*, jitter_m: float, rate_hz: float, rolls_s: float = 12.0) -> list[float]:
    """Speeds from then on of a car that came rough, stands from 6 s on, and pulls away."""
    random = np.random.default_rng(5)

    def place(time_s: float) -> tuple[float, float]:
        t, rolled = min(time_s, 6.0), max(0.0, time_s - rolls_s)
        off = random.normal(0.0, jitter_m if time_s < 6.0 else 0.001, 2)
        return 9.0 * t - 0.75 * t * t + 0.5 * rolled * rolled + off[0], float(off[1])

    states = states_of(along(place, 20.0, rate_hz=rate_hz))
    return [state.speed_mps for state in states if state.stamp_ns > rolls_s * 1e9]


def test_a_car_that_pulls_away_moves_at_once_however_rough_its_fixes_were_on_the_move() -> None:
    speeds = pulling_away(jitter_m=0.3, rate_hz=4.0)
    assert speeds[3] > 0.3, "a second later, 0.5 m on, at 1 m/s"


def test_between_fixes_a_second_apart_one_step_shows_that_it_rolls() -> None:
    first = pulling_away(jitter_m=0.0, rate_hz=1.0, rolls_s=11.45)[0]
    assert first > 0.0


def test_a_car_that_turns_is_followed() -> None:
    for state in states_of(along(circle, 20.0))[20:]:
        expected = 0.4 * state.stamp_ns * 1e-9
        assert abs(math.remainder(yaw(state) - expected, math.tau)) < 0.1


def test_headings_beside_positions_end_a_reverse_that_no_car_drives() -> None:
    """It turned round unseen, and crept away before courses were told: that looks like backing."""
    estimator, x_m, speed_mps = StateEstimator(info()), 0.0, 8.0
    for second in range(45):
        yaw_rad = 0.0 if second < 20 else math.pi
        speed_mps = max(0.0, speed_mps - 2.0) if 10 <= second < 20 else speed_mps
        speed_mps = speed_mps if second < 20 else 0.4 * (second - 19)
        x_m += speed_mps * math.cos(yaw_rad)
        if speed_mps > 2.0:
            heading = HeadingSample(stamp_ns=second * 10**9, yaw_rad=yaw_rad)
            estimator.handle("heading", heading)
        state = estimator.handle(*fix(float(second), x_m, 0.0))
    assert state is not None
    assert state.speed_mps == pytest.approx(speed_mps, abs=0.5)
    assert abs(math.remainder(yaw(state) - math.pi, math.tau)) < 0.1
