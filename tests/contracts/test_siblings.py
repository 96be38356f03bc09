"""A second engine is off unless it is asked for, and has a share of one core."""

from __future__ import annotations

import pytest

from foretwin.contracts.siblings import APART_AFTER_S, Siblings
from foretwin.contracts.simulation import AMBER_FROM, GREEN_TO, HORIZONS_S, RED_FROM
from tests.pages import page


def test_it_is_off_unless_it_is_asked_for() -> None:
    assert not Siblings().on
    assert Siblings(engine="multibody").on
    assert Siblings().share == 0.2


@pytest.mark.parametrize("share", [0.0, -0.1, 1.1, float("nan")])
def test_a_share_is_of_one_core(share: float) -> None:
    assert Siblings(share=1.0).trouble() is None
    assert Siblings(share=share).trouble() == f"share {share:g}: above 0, at most 1"


def test_it_is_told_at_instants_at_which_the_drive_is_compared() -> None:
    assert HORIZONS_S == (*APART_AFTER_S, 8.0) == (1.0, 2.0, 4.0, 8.0)


def test_the_page_tells_which_futures_are_red() -> None:
    """Of these alone who drives should know that engines disagree."""
    assert "green below 1e-8, amber about 1e-6, red from 1e-4" in page("viewer.md")
    assert (GREEN_TO, AMBER_FROM, RED_FROM) == (1e-8, 1e-6, 1e-4)
