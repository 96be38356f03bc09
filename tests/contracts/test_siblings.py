"""A second engine is off unless it is asked for, and has a share of one core."""

from __future__ import annotations

import pytest

from foretwin.contracts.siblings import APART_AFTER_S, Siblings
from foretwin.contracts.simulation import HORIZONS_S


def test_it_is_off_unless_it_is_asked_for() -> None:
    assert not Siblings().on
    assert Siblings(engine="multibody").on
    assert Siblings().share == 0.2


@pytest.mark.parametrize("share", [0.0, -0.1, 1.1, float("nan")])
def test_a_share_is_of_one_core(share: float) -> None:
    assert Siblings(share=1.0).trouble() is None
    assert Siblings(share=share).trouble() == f"share {share:g}: above 0, at most 1"


def test_it_is_told_at_instants_at_which_the_drive_is_compared() -> None:
    assert HORIZONS_S[: len(APART_AFTER_S)] == APART_AFTER_S
