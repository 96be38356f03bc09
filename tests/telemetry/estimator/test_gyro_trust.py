"""A gyro that does not turn as the car does is left out; one that does never is."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.telemetry.estimator.gyro_trust import GyroTrust
from foretwin.telemetry.estimator.motion_corrections import TURNS_OTHERWISE
from tests.telemetry.position_track import yaw
from tests.telemetry.winding_drive import TICK_S, WINDING, driven


@pytest.mark.parametrize("gain", [0.0, -1.0, 57.3])
@pytest.mark.parametrize(
    "sensors",
    [{}, {"wheels": True}, {"headings": True, "wheels": True}],
    ids=["fixes", "wheels", "all"],
)
def test_a_gyro_stuck_upside_down_or_in_degrees_does_not_lead_the_car(
    gain: float, sensors: dict[str, bool]
) -> None:
    estimator, states = driven(gain, **sensors)
    assert estimator.gyro_refused
    after = [(WINDING[tick], state) for tick, state in states if tick * TICK_S > 20.0]
    assert len(after) > 900
    for (speed, _, heading, _, _), state in after:
        assert abs(math.remainder(yaw(state) - heading, math.tau)) < math.radians(2.0)
        assert abs(state.speed_mps - speed) < 0.1
        assert "yaw_rate_radps" in state.estimated


def test_a_gyro_that_turns_as_the_car_does_counts_as_measured() -> None:
    estimator, states = driven(1.0)
    assert not estimator.gyro_refused
    assert all("yaw_rate_radps" not in state.estimated for _, state in states)


def test_a_gyro_that_has_come_right_is_believed_again() -> None:
    estimator, states = driven(-1.0, right_from_s=40.0, wheels=True)
    refused = estimator.skipped[TURNS_OTHERWISE]
    assert 0 < refused < 90.0 / TICK_S
    assert "yaw_rate_radps" not in states[-1][1].estimated


@given(
    gain=st.floats(0.7, 1.3),
    bias_radps=st.floats(-0.02, 0.02),
    late_s=st.floats(0.0, 2.0),
    ahead_m=st.floats(-1.0, 4.0),
    noise_m=st.floats(0.0, 2.0),
    seed=st.integers(0, 1000),
)
def test_an_honest_gyro_is_believed_whatever_fixes_are_like(
    gain: float, bias_radps: float, late_s: float, ahead_m: float, noise_m: float, seed: int
) -> None:
    """Fixes of 5 Hz that come late, of an antenna ahead of the axle, with white noise."""
    trust, random, late = GyroTrust(), np.random.default_rng(seed), round(late_s / TICK_S)
    for tick, (_, rate, _, _, _) in enumerate(WINDING):
        trust.turn(round(tick * TICK_S * 1e9), gain * rate + bias_radps)
        if tick % 10 == 0 and tick >= late:
            _, _, heading, x, y = WINDING[tick - late]
            place = np.array([x + ahead_m * math.cos(heading), y + ahead_m * math.sin(heading)])
            noisy = place + random.normal(0.0, noise_m, 2)
            trust.take(round(tick * TICK_S * 1e9), noisy, max(noise_m, 0.02))
        assert trust.believed


def test_a_car_that_goes_to_and_fro_or_a_receiver_that_jumps_says_nothing_of_a_gyro() -> None:
    trust = GyroTrust()
    for tick in range(3000):
        time_s = tick * TICK_S
        trust.turn(round(time_s * 1e9), 0.0)
        if tick % 10 == 0:
            there = 8.0 * math.sin(0.4 * time_s)
            jump = 6.0 * (tick // 500 % 2)
            trust.take(round(time_s * 1e9), np.array([there, jump]), 0.02)
        assert trust.believed


def test_a_copy_goes_on_by_itself() -> None:
    trust = GyroTrust()
    trust.turn(0, 0.0)
    other = trust.copy()
    for tick, (_, rate, _, x, y) in enumerate(WINDING):
        other.turn(round(tick * TICK_S * 1e9), -rate)
        other.take(round(tick * TICK_S * 1e9), np.array([x, y]), 0.02)
    assert (trust.believed, other.believed) == (True, False)
