"""Straight pieces between fixes, and a sensor's value at any instant meanwhile."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.telemetry.estimator.chords import Chords, Trail


def test_chords_follow_each_other_and_are_as_long_as_noise_asks() -> None:
    chords = Chords()
    found = [chords.take(0.1 * k, np.array([0.0, 1.0 * k]), std_m=0.5) for k in range(40)]
    ended = [one for one in found if one is not None]
    assert [one.length_m for one in ended] == pytest.approx([8.0] * len(ended))
    assert len(ended) == 4
    assert all(a.to_s == b.from_s for a, b in itertools.pairwise(ended))
    assert all(one.course_rad == pytest.approx(math.pi / 2.0) for one in ended)


def test_nobody_knows_how_a_car_went_that_took_long() -> None:
    chords = Chords()
    assert chords.take(0.0, np.zeros(2), 0.02) is None
    assert chords.take(7.0, np.array([9.0, 0.0]), 0.02) is None
    assert chords.take(8.0, np.array([18.0, 0.0]), 0.02) is not None


@given(st.floats(0.02, 1.0), st.floats(-2.0, 2.0), st.floats(0.0, 10.0))
def test_an_even_rate_makes_an_even_way(period_s: float, rate: float, ago_s: float) -> None:
    trail = Trail()
    count = int(15.0 / period_s)
    for k in range(count + 1):
        trail.go_on(k * period_s, rate)
    now_s = count * period_s
    now, before = trail.at(now_s), trail.at(now_s - ago_s)
    assert now is not None
    assert before is not None
    assert now - before == pytest.approx(rate * ago_s, abs=1e-6)


def test_what_is_not_known_is_none() -> None:
    trail = Trail()
    assert trail.at(0.0) is None
    for k in range(300):
        trail.go_on(0.1 * k, 1.0)
    assert trail.at(1.0) is None, "too long ago"
    assert trail.at(29.5) is not None
    assert trail.at(33.0) is None
    trail.go_on(40.0, 1.0)
    assert trail.at(29.5) is None, "before a gap"


def test_angles_go_the_short_way_round() -> None:
    trail = Trail()
    for k in range(20):
        trail.turn_to(0.1 * k, math.remainder(0.5 * k, math.tau))
    assert trail.at(1.9) == pytest.approx(9.5)
    other = trail.copy()
    other.turn_to(2.0, 0.0)
    assert trail.at(1.9) == pytest.approx(9.5)
