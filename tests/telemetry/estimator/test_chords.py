"""Straight pieces between fixes, and a sensor's value at any instant meanwhile."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.telemetry.estimator.chords import Chord, ChordBegun, Trail


def test_a_chord_is_as_long_as_noise_asks() -> None:
    begun = ChordBegun(1.0, np.zeros(2))
    assert begun.to(2.0, np.array([0.0, 7.0]), std_m=0.5) is None
    assert begun.to(6.5, np.array([0.0, 8.0]), std_m=0.5) is None, (
        "fixes of a car that stands wander"
    )
    chord = begun.to(2.0, np.array([0.0, 8.0]), std_m=0.5)
    assert chord == Chord(1.0, 2.0, 8.0, pytest.approx(math.pi / 2.0))
    assert chord.middle_s == 1.5


@pytest.mark.parametrize(
    ("lasts_s", "known"), [(0.4, False), (0.6, True), (5.9, True), (6.1, False)]
)
def test_nobody_knows_how_a_car_went_that_took_long(lasts_s: float, known: bool) -> None:
    begun = ChordBegun(0.0, np.zeros(2))
    assert (begun.to(lasts_s, np.array([9.0, 0.0]), 0.02) is not None) == known


@given(st.floats(0.02, 1.0), st.floats(-2.0, 2.0), st.floats(0.0, 10.0))
def test_an_even_rate_makes_an_even_way(period_s: float, rate: float, ago_s: float) -> None:
    trail = Trail()
    count = int(15.0 / period_s)
    for k in range(count + 1):
        trail = trail.gone_on(k * period_s, rate)
    now_s = count * period_s
    now, before = trail.at(now_s), trail.at(now_s - ago_s)
    assert now is not None
    assert before is not None
    assert now - before == pytest.approx(rate * ago_s, abs=1e-6)


def test_what_is_not_known_is_none() -> None:
    trail = Trail()
    assert trail.at(0.0) is None
    for k in range(300):
        trail = trail.gone_on(0.1 * k, 1.0)
    assert trail.at(1.0) is None, "too long ago"
    assert trail.at(29.5) is not None
    assert trail.at(33.0) is None
    trail = trail.gone_on(40.0, 1.0)
    assert trail.at(29.5) is None, "before a gap"


def test_angles_go_the_short_way_round() -> None:
    trail = Trail()
    for k in range(20):
        trail = trail.turned_to(0.1 * k, math.remainder(0.5 * k, math.tau))
    assert trail.at(1.9) == pytest.approx(9.5)
