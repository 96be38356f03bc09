"""What may be asked of virtual traffic."""

from __future__ import annotations

import msgspec
import pytest

from foretwin.contracts.virtual_traffic import VirtualTraffic


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({}, None),
        ({"count": 500}, None),
        ({"count": 0}, "count 0: 1 to 500"),
        ({"count": 501}, "count 501: 1 to 500"),
        ({"seed": -1}, "seed -1: 0 to 9223372036854775807"),
        ({"seed": 0}, None),
        (
            {"source": "sumo"},
            'source sumo needs network = "FILE.xodr", as foretwin world --bbox writes it',
        ),
    ],
)
def test_what_cannot_be_is_said(changes: dict[str, int | str], said: str | None) -> None:
    chosen = msgspec.convert({"source": "model"} | changes, VirtualTraffic)
    assert chosen.trouble() == said


def test_a_word_that_it_does_not_know_is_none_that_it_passes_over() -> None:
    with pytest.raises(msgspec.ValidationError, match="contains unknown field `cuont`"):
        msgspec.convert({"source": "model", "cuont": 5}, VirtualTraffic)
