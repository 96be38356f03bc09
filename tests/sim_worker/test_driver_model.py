"""The intelligent driver model: what it wants ahead."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.sim_worker.driver_model import (
    ALONG_COS,
    COMFORT_DECEL_MPS2,
    LATERAL_ACCEL_MPS2,
    LINE_DECEL_MPS2,
    MAX_DECEL_MPS2,
    dynamic_gap_m,
    improved_idm_mps2,
)
from foretwin.sim_worker.metrics.comfort import BOUNDS


def wanted_m(speed_mps: float, lead_mps: float, *, time_gap_s: float = 1.5) -> float:
    return float(
        dynamic_gap_m(np.array([speed_mps]), np.array([lead_mps]), time_gap_s, 1.0, 4.0)[0]
    )


@given(speed=st.floats(0.0, 40.0), time_gap=st.floats(0.5, 2.0))
def test_behind_an_equally_fast_leader_the_time_gap_alone_counts(speed, time_gap):
    assert wanted_m(speed, speed, time_gap_s=time_gap) == pytest.approx(speed * time_gap)


def test_closing_in_wants_more_and_falling_back_no_less_than_nothing() -> None:
    assert wanted_m(10.0, 6.0) == pytest.approx(15.0 + 10.0 * 4.0 / (2.0 * 2.0))
    assert wanted_m(10.0, 40.0) == 0.0


def chosen_mps2(speed_mps: float, share: float, *, desired_mps: float = 10.0) -> float:
    """What a driver of 2 m/s² and 3 m/s² chooses who wants `share` of the gap that there is."""
    numbers = (np.array([v]) for v in (speed_mps, desired_mps, share, 2.0, 3.0))
    return float(improved_idm_mps2(*numbers)[0])


@given(speed=st.floats(0.0, 9.99))
def test_who_has_the_gap_that_it_wants_keeps_it_however_near_its_own_speed(speed: float) -> None:
    assert chosen_mps2(speed, 1.0) == pytest.approx(0.0, abs=1e-9)
    # IDM itself brakes there, and falls back to a multiple of that gap.
    assert chosen_mps2(speed, 0.5) >= 0.0
    assert chosen_mps2(speed, 1.5) == pytest.approx(-2.5)


@given(speed=st.floats(0.0, 30.0), share=st.floats(0.0, 5.0))
def test_who_is_ahead_only_ever_slows_a_driver_down(speed: float, share: float) -> None:
    free = chosen_mps2(speed, 0.0)
    assert chosen_mps2(speed, share) <= free + 1e-12
    assert abs(chosen_mps2(speed, 1.0 - 1e-9) - chosen_mps2(speed, 1.0)) < 1e-6
    assert free == pytest.approx(2.0 * (1.0 - (speed / 10.0) ** 4)) if speed <= 10.0 else free < 0.0
    assert free >= -3.0


def test_drivers_are_comfortable_by_the_bounds_that_they_are_judged_by() -> None:
    assert BOUNDS["lat_accel_mps2"][1] > LATERAL_ACCEL_MPS2
    assert -BOUNDS["lon_accel_mps2"][0] > COMFORT_DECEL_MPS2
    assert COMFORT_DECEL_MPS2 < LINE_DECEL_MPS2 < MAX_DECEL_MPS2
    assert pytest.approx(np.cos(np.radians(60.0))) == ALONG_COS
