"""Where a car comes to that keeps its yaw rate and acceleration, against small steps of it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.geometry.constant_turn import constant_turn_rate

START = np.array([3.0, -2.0, 0.7])
STEP_S = 1e-4


def stepped(
    speed_mps: float, accel_mps2: float, yaw_rate_radps: float, for_s: float
) -> list[float]:
    """The same motion in small steps, taken in the middle of each."""
    time_s = np.arange(STEP_S / 2, for_s, STEP_S)
    speed = speed_mps + accel_mps2 * time_s
    if accel_mps2 * speed_mps < 0.0:
        time_s = time_s[speed * speed_mps > 0.0]
        speed = speed_mps + accel_mps2 * time_s
    yaw = START[2] + yaw_rate_radps * time_s
    x, y = np.sum(speed * np.cos(yaw)) * STEP_S, np.sum(speed * np.sin(yaw)) * STEP_S
    turned = yaw_rate_radps * len(time_s) * STEP_S
    return [START[0] + x, START[1] + y, START[2] + turned]


@given(
    st.floats(-5.0, 30.0), st.floats(-9.0, 5.0),
    st.floats(-2.0, 2.0) | st.sampled_from([0.0, 1e-7, 2e-6, -1e-5]), st.floats(0.0, 1.0),
)  # fmt: skip
def test_it_comes_where_small_steps_come(
    speed_mps: float, accel_mps2: float, yaw_rate_radps: float, for_s: float
) -> None:
    (end,) = constant_turn_rate(
        START,
        speed_mps=speed_mps,
        accel_mps2=accel_mps2,
        yaw_rate_radps=yaw_rate_radps,
        time_s=np.array([for_s]),
    )
    assert end == pytest.approx(
        stepped(speed_mps, accel_mps2, yaw_rate_radps, for_s), abs=40 * STEP_S
    )


@pytest.mark.parametrize("yaw_rate_radps", [0.0, 0.5])
def test_who_brakes_stands_still_in_the_end_and_never_goes_back(yaw_rate_radps: float) -> None:
    poses = constant_turn_rate(
        START,
        speed_mps=4.0,
        accel_mps2=-8.0,
        yaw_rate_radps=yaw_rate_radps,
        time_s=np.array([0.5, 3.0]),
    )
    assert poses[1].tolist() == poses[0].tolist()
    assert np.hypot(*(poses[0] - START)[:2]) == pytest.approx(1.0, abs=0.01)
