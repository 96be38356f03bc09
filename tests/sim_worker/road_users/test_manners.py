"""Drivers differ, each as its names have it, and alike wherever it is asked."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

from foretwin.sim_worker.road_users.manners import SPREADS, Manners, key_of, manners

KEYS = np.arange(40_000).reshape(200, 200)
MANY = manners(range(200), KEYS)


@pytest.mark.parametrize(("number", "name"), list(enumerate(Manners._fields)))
def test_they_lie_about_the_median_as_the_table_says(number: int, name: str) -> None:
    median, spread = SPREADS[number]
    found = np.log(MANY[number])
    assert np.exp(np.median(found)) == pytest.approx(median, rel=0.01)
    # Nobody is beyond two standard deviations, which are less wide for it.
    assert found.std() == pytest.approx(0.96 * spread, rel=0.03)
    assert np.abs(found - np.log(median)).max() <= 2.0 * spread + 1e-9


def test_numbers_of_a_driver_have_nothing_to_do_with_each_other() -> None:
    ranks = np.corrcoef([np.log(column).ravel() for column in MANY])
    assert np.abs(ranks - np.eye(len(ranks))).max() < 0.03


def test_a_driver_is_the_same_beside_whomever_it_is() -> None:
    alone = manners([7], np.array([[11]]))
    among = manners([3, 7], np.array([[11, 12, 13], [9, 11, 10]]))
    assert all(a[0, 0] == b[1, 1] for a, b in zip(alone, among, strict=True))
    assert alone.time_gap_s[0, 0] != among.time_gap_s[0, 0], "another future, another driver"


def test_keys_are_the_same_in_every_process() -> None:
    code = "from foretwin.sim_worker.road_users.manners import key_of; print(key_of(3, 'a b', 1.5))"
    there = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert int(there.stdout) == key_of(3, "a b", 1.5)
