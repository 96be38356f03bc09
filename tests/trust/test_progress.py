"""Forecasts of progress over a drive through a town without a town."""

from __future__ import annotations

from functools import cache

import numpy as np

from foretwin.contracts.forecast import PROGRESS_TIMES_S
from foretwin.orchestrator.forecast.progress_model import progress_model
from foretwin.orchestrator.forecast.scoring import DriveScore, score
from tests.orchestrator.forecast.town_drives import town_examples
from tests.trust.progress import LEARNT_FROM, RANKS, DriveForecasts, pooled, row


@cache
def scores() -> tuple[DriveScore, ...]:
    drive = town_examples(seed=4, minutes=3.0)
    return tuple(score(progress_model(), drive, blind=blind) for blind in (True, False))


def town(name: str) -> DriveForecasts:
    return DriveForecasts(name, 340.0, *scores())


def test_a_row_has_as_many_cells_as_its_head() -> None:
    told = row(town("town"))

    assert told.count("|") == 10
    assert "(learnt from)" not in told
    assert "(learnt from)" in row(town(LEARNT_FROM[0]))


def test_what_was_learnt_from_is_not_pooled() -> None:
    assert pooled([town(LEARNT_FROM[0])]) == []
    first, ranks = pooled([town("one"), town(LEARNT_FROM[0])])
    assert "over 1 drives" in first
    parts = [float(part) for part in ranks.removeprefix("Ranks: ").split(",")]
    assert len(parts) == RANKS
    assert np.isclose(sum(parts), 1.0, atol=0.01)


def test_what_really_came_is_what_is_scored() -> None:
    """A car that measures its speed right, beside one whose truth is a tenth farther."""
    drive = town_examples(seed=4, minutes=3.0)
    right, _ = scores()
    farther = score(progress_model(), drive, blind=True, truth_m=1.1 * drive.distance_m)
    moved = drive.distance_m[drive.speed_mps >= 0.5]

    sure = drive._replace(speed_std_mps=np.zeros_like(drive.speed_std_mps))
    unsure = drive._replace(speed_std_mps=np.full_like(drive.speed_std_mps, 0.5))
    widths = [
        score(progress_model(), one, truth_m=one.distance_m).width_m for one in (sure, unsure)
    ]
    assert widths[1][:, 0].mean() > 1.5 * widths[0][:, 0].mean()
    assert np.array_equal(right.width_m, score(progress_model(), unsure, blind=True).width_m)
    assert farther.share.mean() > right.share.mean() + 0.02
    steady = drive.speed_mps[drive.speed_mps >= 0.5][:, None] * np.array(PROGRESS_TIMES_S)
    assert np.allclose(farther.constant_speed_off_m, np.abs(steady - 1.1 * moved))
