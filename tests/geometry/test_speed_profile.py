"""Speeds along a path: bends, brakes and drive."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.geometry.speed_profile import accelerated, braked, speed_in_bends_mps

LINE = np.stack([np.linspace(0.0, 50.0, 51), np.zeros(51)], axis=-1)


def test_a_bend_is_driven_with_the_lateral_acceleration_asked_for() -> None:
    assert speed_in_bends_mps(np.array([0.1, -0.1]), 2.5).tolist() == [5.0, 5.0]
    assert speed_in_bends_mps(np.zeros(1), 2.5)[0] > 1000.0


@given(stop=st.integers(1, 49), decel=st.floats(0.5, 8.0))
def test_brakes_and_drive_hold_speeds_that_mirror_each_other_around_a_stop(stop, decel):
    wished = np.full(51, 20.0)
    wished[stop] = 0.0
    before, behind = braked(wished, LINE, decel), accelerated(wished, LINE, decel)
    way = np.abs(LINE[:, 0] - LINE[stop, 0])
    held = np.minimum(np.sqrt(2.0 * decel * way), 20.0)
    np.testing.assert_allclose(before[: stop + 1], held[: stop + 1], rtol=1e-9)
    np.testing.assert_allclose(behind[stop:], held[stop:], rtol=1e-9)
    assert before[stop + 1 :].tolist() == wished[stop + 1 :].tolist()
    assert behind[:stop].tolist() == wished[:stop].tolist()


def test_speeds_that_no_car_could_change_between_equal_points_become_equal() -> None:
    twice = np.array([[0.0, 0.0], [0.0, 0.0], [3.0, 0.0]])
    assert braked(np.array([9.0, 2.0, 2.0]), twice, 2.0)[0] == pytest.approx(2.0)
