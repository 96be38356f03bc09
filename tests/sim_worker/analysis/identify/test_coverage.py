"""95 % intervals hold the truth as often as they say (some ten minutes: `make judge`)."""

from __future__ import annotations

import pytest

from tests.sim_worker.analysis.identify.coverage import cases, coverage

CARS = 100


@pytest.mark.judge
@pytest.mark.timeout(3600)
def test_intervals_hold_the_truth_of_a_hundred_cars() -> None:
    told = [case for seed in range(CARS) for case in cases(seed)]
    counts = coverage(told)
    outside = {
        name: f"{held} of {of}"
        for name, (held, of) in counts.items()
        if of < CARS // 2 or not 0.90 <= held / of <= 0.99
    }
    assert not outside
