"""What futures are made of."""

from __future__ import annotations

from foretwin.contracts.futures import STATE_COLUMNS


def test_the_columns_of_a_state() -> None:
    assert len(STATE_COLUMNS) == len(set(STATE_COLUMNS)) == 8
    assert STATE_COLUMNS[:3] == ("x_m", "y_m", "yaw_rad")
