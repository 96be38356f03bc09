"""Instants of a drive with the streets that it was near."""

from __future__ import annotations

import pytest

from foretwin.orchestrator.record.whereabouts import driven_s, instant, junction_name, where_at

JUNCTIONS = [
    {"id": "n1", "name": "Mill Lane \u00d7 High Street", "arrived_at_s": 12.0},
    {"id": "n2", "name": "", "arrived_at_s": 30.0},
    {"id": "n3", "name": "Never Way", "arrived_at_s": None},
]


def test_an_instant_is_before_the_junction_that_comes_or_after_the_last() -> None:
    assert (
        where_at(3.0, JUNCTIONS)
        == where_at(12.0, JUNCTIONS)
        == "before Mill Lane \u00d7 High Street"
    )
    assert where_at(12.1, JUNCTIONS) == "before n2"
    assert where_at(30.1, JUNCTIONS) == "after n2"
    assert instant(3.04, JUNCTIONS) == "at 3.0 s, before Mill Lane \u00d7 High Street"


def test_without_junctions_only_the_time_is_told() -> None:
    assert instant(3.0, []) == instant(3.0, JUNCTIONS[2:]) == "at 3.0 s"
    assert junction_name(JUNCTIONS[1]) == "n2"


def test_what_start_left_out_was_not_driven() -> None:
    assert driven_s({"drive_time_s": 696.9, "config": {"start_s": 640.0}}) == pytest.approx(56.9)
    assert driven_s({"drive_time_s": 60.0, "config": None}) == driven_s({"drive_time_s": 60.0})
    assert driven_s({"drive_time_s": 60.0}) == 60.0
    assert driven_s({"drive_time_s": 0.0, "config": {"start_s": 5.0}}) == 0.0  # no sample came
    assert driven_s({"drive_time_s": None}) is driven_s({}) is None
