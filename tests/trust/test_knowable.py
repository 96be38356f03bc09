"""Tables of places whose times are known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.trust.knowable import learnt_s, off_row, told_row
from tests.trust.places_ahead import Came, Place, Told


def test_between_before_and_after_are_told_apart() -> None:
    ten = [Came(Told(10.0, 100.0, 8.0, 12.0), came_s) for came_s in (7.0, 9.0, 11.0, 13.0)]
    five = [Came(Told(5.0, 50.0, 4.0, math.inf), came_s) for came_s in (3.0, 99.0)]

    assert told_row("x", ten) == "| x | 50 / 25 / 25 (4), 0, 4.0 s | - |"
    assert told_row("x", five) == "| x | - | 50 / 50 / 0 (2), 100, nan s |"


def test_what_is_off_is_told_with_its_sign() -> None:
    assert off_row("x", np.array([8.0, 9.0, 10.0])) == "| x | 3 | 1.00 | 1.90 | -1.00 |"


def test_an_oracle_tells_what_no_tree_knows() -> None:
    rng = np.random.default_rng(0)
    least = rng.uniform(1.0, 10.0, 4000)
    later = 10.0 + 0.5 * (10.0 - least)
    some = [
        Place(late, 10.0, slow, 10.0, [100.0, float(noise)])
        for late, slow, noise in zip(later, least, rng.normal(size=4000), strict=True)
    ]
    blind = learnt_s(some[:3000], some[3000:], oracle=False)
    told = learnt_s(some[:3000], some[3000:], oracle=True)

    assert np.abs(told - later[3000:]).max() < 0.3
    assert np.abs(blind - later[3000:]).mean() == pytest.approx(1.1, abs=0.15)
