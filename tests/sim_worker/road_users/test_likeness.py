"""What is said of how alike drivers are is what is measured, and better than it was."""

from __future__ import annotations

from pathlib import Path

import pytest

from foretwin.sim_worker.road_users.likeness import likeness_words, likenesses
from tests.sim_worker.realism.__main__ import crossings, likeness_rows

BEFORE = {
    "speed": 1.268, "acceleration": 0.858, "deceleration": 0.757, "lateral": 0.172, "gap": 2.887,
    "headway": 1.269,
}  # fmt: skip
"""Karlsruhe, before other drivers had manners of their own."""


def test_the_line_names_every_quantity_with_its_unit() -> None:
    said = likeness_words()
    assert "not fitted to (karlsruhe)" in said
    for row in likenesses():
        assert row.fitted or f"{row.quantity} {row.distance:.2f} {row.unit}" in said


def test_drivers_are_nearer_to_those_that_they_were_not_fitted_to_than_before() -> None:
    share = {
        row.quantity: row.distance / BEFORE[row.quantity] for row in likenesses() if not row.fitted
    }
    assert max(share.values()) < 0.8
    assert sorted(share.values())[2] <= 0.5


@pytest.mark.real_data
@pytest.mark.judge
def test_what_is_stated_is_what_is_measured(data_dir: Path) -> None:
    assert tuple(likeness_rows(crossings(data_dir))) == likenesses()
