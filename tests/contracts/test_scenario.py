"""Scenarios as their files state them."""

from __future__ import annotations

import msgspec
import pytest

from foretwin.contracts.numbers import FUTURE_NUMBERS
from foretwin.contracts.scenario import Distribution, FaultPart, Scenario

TEXT = """
id = "cut_in"
title = "A car cuts in"
shows = "Whether the ego brakes."
source = "a test"

[[actors]]
name = "other"
relation = "beside"
speed_mps = { min = 5.0, max = 9.0 }

[faults]
friction_factor = 0.5
"""


def test_faults_are_those_of_the_table_and_neutral_unless_stated() -> None:
    faults = {name: row.neutral for name, row in FUTURE_NUMBERS.items() if row.part == "fault"}
    assert msgspec.to_builtins(FaultPart()) == faults


def test_a_file_becomes_a_scenario() -> None:
    found = msgspec.toml.decode(TEXT, type=Scenario)
    (other,) = found.actors
    assert other.speed_mps == Distribution(min=5.0, max=9.0)
    assert (other.kind, other.conduct, other.gap_m) == ("car", "heedless", 20.0)
    assert found.faults.friction_factor == 0.5
    assert found.faults.steering_gain == 1.0


@pytest.mark.parametrize(
    ("before", "after", "complaint"),
    [
        ('"beside"', '"above"', "Invalid enum value 'above'"),
        ("friction_factor", "grip", "unknown field `grip`"),
        ("[[actors]]", "[[actor]]", "unknown field `actor`"),
    ],
)
def test_a_word_that_is_no_key_or_value_is_refused(before: str, after: str, complaint: str) -> None:
    with pytest.raises(msgspec.ValidationError, match=complaint):
        msgspec.toml.decode(TEXT.replace(before, after), type=Scenario)
