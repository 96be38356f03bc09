"""What futures are made of."""

from __future__ import annotations

from foretwin.contracts.futures import (
    PATH_BEHIND_M,
    RESULT_STEP_S,
    SPEED_AHEAD_STEP_S,
    STATE_COLUMNS,
)


def test_a_future_is_told_ten_times_a_second_and_aims_at_a_speed_twice() -> None:
    assert (RESULT_STEP_S, SPEED_AHEAD_STEP_S, PATH_BEHIND_M) == (0.1, 0.5, 10.0)


def test_the_columns_of_a_state() -> None:
    assert len(STATE_COLUMNS) == len(set(STATE_COLUMNS)) == 8
    assert STATE_COLUMNS[:3] == ("x_m", "y_m", "yaw_rad")
