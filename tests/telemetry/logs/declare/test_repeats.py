"""What tells a new value of a sensor whose rows repeat the old one."""

from __future__ import annotations

import numpy as np
import pytest

from foretwin.contracts.arrays import Array
from foretwin.telemetry.logs.declare.repeats import new_when

TIME_S = np.arange(0.0, 120.0, 0.1)
MOVES = np.ones(len(TIME_S), dtype=bool)


def held(every: int) -> Array:
    """A speed that a table at 10 Hz holds anew in every so-manieth row."""
    speed = 9.0 + 5.0 * np.sin(TIME_S / 9.0) + 0.01 * np.sin(TIME_S * 7.0)
    return np.repeat(speed[::every], every)[: len(TIME_S)]


@pytest.mark.parametrize(("every", "again_s"), [(2, 0.4), (5, 1.0), (10, 2.0)])
def test_what_stands_for_twice_its_period_is_new_again(every: int, again_s: float) -> None:
    told = new_when(["v"], {"v": held(every)}, TIME_S, MOVES)
    assert told is not None
    assert told.columns == ("v",)
    assert told.again_s == pytest.approx(again_s)


def test_a_counter_tells_it_better_and_a_sensor_new_in_each_row_needs_none() -> None:
    counter = np.repeat(np.arange(len(TIME_S) // 5), 5).astype(np.float64)
    told = new_when(["v"], {"v": held(5), "n": counter}, TIME_S, MOVES)
    assert told is not None
    assert (told.columns, told.again_s) == (("n",), 0.0)
    assert new_when(["v"], {"v": held(1)}, TIME_S, MOVES) is None
