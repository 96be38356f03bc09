"""Who mistypes a name is told the nearest known one, and all of them."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.contracts.did_you_mean import meant, one_of

SETTINGS = "futures", "futures_per_job", "rate_hz", "horizon_s", "map", "map_aiding", "log"


@pytest.mark.parametrize(
    ("typed", "near"),
    [
        ("futrues", "futures"),
        ("futures-per-job", "futures_per_job"),
        ("RATE_HZ", "rate_hz"),
        ("horizon", "horizon_s"),
        ("hor", "horizon_s"),
        ("lgo", "log"),
    ],
)
def test_the_nearest_name_is_told(typed: str, near: str) -> None:
    assert meant(typed, SETTINGS) == f"did you mean {near}? "


@pytest.mark.parametrize("typed", ["", "x", "temperature"])
def test_nothing_is_told_where_nothing_is_near(typed: str) -> None:
    assert meant(typed, SETTINGS) == ""


def test_all_are_told_after_the_nearest() -> None:
    assert one_of("nativ", ("auto", "native")) == "did you mean native? one of auto, native"
    assert one_of("window", ("auto", "native")) == "one of auto, native"


@given(st.sampled_from(SETTINGS))
def test_a_known_name_means_itself(name: str) -> None:
    assert meant(name, SETTINGS) == f"did you mean {name}? "
