"""What drivers know is late where something changes, and right where nothing does."""

from __future__ import annotations

import numpy as np
import pytest

from foretwin.contracts.arrays import Array
from foretwin.sim_worker.road_users.noticed import Noticed

ROW, COLUMN = np.zeros(1, np.intp), np.zeros(1, np.intp)
TWO = np.arange(2), np.zeros(2, np.intp)


def known(noticed: Noticed, end_m: float, speed_mps: float) -> Array:
    ahead = np.array([[end_m], [speed_mps], [2.0]])
    return noticed.after(ahead, every_s=0.2)[:, 0]


def test_who_keeps_its_speed_is_where_it_is_expected() -> None:
    noticed = Noticed(np.array([0.8]), ROW, COLUMN)
    for step in range(20):
        found = known(noticed, 50.0 + 10.0 * 0.2 * step, 10.0)
        assert found == pytest.approx([50.0 + 10.0 * 0.2 * step, 10.0, 2.0])


@pytest.mark.parametrize(("reaction_s", "late"), [(0.0, 0), (0.8, 4), (1.0, 5)])
def test_brakes_are_noticed_after_the_reaction(reaction_s: float, late: int) -> None:
    noticed = Noticed(np.array([reaction_s]), ROW, COLUMN)
    speeds = [10.0] * 10 + [5.0] * 10
    seen = [known(noticed, 0.0, speed)[1] for speed in speeds]
    assert seen.index(5.0) == 10 + late


def test_those_who_begin_anew_know_at_once_and_others_go_on() -> None:
    before, after = (Noticed(np.array([0.6, 0.6]), *TWO) for _ in range(2))
    for step in range(8):
        before.after(np.array([[step, step], [0.0, 0.0], [2.0, 2.0]]), every_s=0.2)
    after.carry_on(before, np.array([True, False]))
    found = after.after(np.full((3, 2), 100.0), every_s=0.2)
    assert found[0].tolist() == [5.0, 100.0]
