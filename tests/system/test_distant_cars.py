"""Cars on lots far apart are judged as if they stood side by side."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from tests.system.distant_cars import Judged, Told, met, summary
from tests.system.true_meetings import TrueMeeting

COVERS = ("foretwin.telemetry.standin.__main__",)
LAPS = 3


@pytest.mark.judge
@pytest.mark.timeout(580)
def test_cars_on_lots_far_apart_are_judged_as_if_co_located(tmp_path: Path) -> None:
    """`python -m tests.system.distant_cars` has them meet a hundred times."""
    try:
        found = met(tmp_path, seed=19, laps=LAPS)
    except (OSError, subprocess.CalledProcessError) as error:
        pytest.skip(f"no networks of their own here: {error}")
    print(found, summary(found))
    assert len(found) >= 2 * (LAPS - 1)
    assert all(one.right for one in found)


def judged(least_m: float, *told: tuple[float, bool], clear: bool = True) -> Judged:
    truth = TrueMeeting("second", 10.0, least_m, touched=least_m == 0.0, clear=clear)
    return Judged(truth, tuple(Told(*one) for one in told))


def test_an_encounter_is_right_where_it_is_told_once_and_near() -> None:
    assert judged(1.0, (1.19, False)).right
    assert judged(0.0, (0.0, True)).right
    for wrong in (
        judged(1.0, (1.21, False)),
        judged(1.0, (0.79, False)),
        judged(1.0),
        judged(1.0, (1.0, False), (1.4, False)),
        judged(0.3, (0.15, True)),
        judged(0.0, (0.1, False)),
    ):
        assert not wrong.right


def test_a_hair_s_breadth_may_be_judged_otherwise_and_is_counted() -> None:
    hair = judged(0.1, (0.0, True), clear=False)
    assert hair.right
    assert not hair.verdict
    words = summary([hair, judged(1.0, (1.05, False)), judged(0.0, (0.0, True)), judged(2.0)])
    assert words == (
        "3 of 4 encounters judged as if co-located; 1 are touches, of 1 by a hair's breadth 1 were "
        "judged otherwise; least distances at worst inf m off"
    )
