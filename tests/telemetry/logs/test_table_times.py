"""Times of tables: each way of writing one gives the same instant; what is none gives none."""

from __future__ import annotations

import pytest

from foretwin.telemetry.logs.table_times import UNITS, days_counted, stamp_reader, tells_zone

NOON_NS = 1_709_294_400 * 10**9
"""2024-03-01T12:00:00Z."""
DAY_NS = 86_400 * 10**9


@pytest.mark.parametrize(
    ("unit", "text"),
    [
        ("iso8601", "2024-03-01T13:00:00.25+01:00"),
        ("ymd", "2024/03/01 12:00:00.250"),
        ("dmy", "1.3.2024 12:00:00,25"),
        ("dmy", "01/03/24 12:00:00.25"),
        ("dmy", "01-Mar-2024 12:00:00.250"),
        ("dmy", "1. März 2024 12:00:00,25"),
        ("dmy", "1 march 24, 12:00:00.25"),
        ("mdy", "03/01/2024 12:00:00.250 PM"),
        ("mdy", "3/1/2024 14:00:00.25 +02:00"),
        ("days1900", "45352.50000289352"),
        ("datenum", "739312.50000289352"),
        ("s", "1709294400.25"),
        ("ms", "1709294400250"),
    ],
)
def test_an_instant_is_the_same_however_it_is_written(unit: str, text: str) -> None:
    assert stamp_reader(unit)(text) == pytest.approx(NOON_NS + 250_000_000, abs=1000)


@pytest.mark.parametrize(
    ("unit", "text", "of_day_s"),
    [
        ("clock", "09:30:02,5", 34_202.5),
        ("clock", "12:00:01.0 AM", 1.0),
        ("hhmmss", "93002.5", 34_202.5),
        ("hhmmss", "000001", 1.0),
    ],
)
def test_times_of_the_day_count_from_midnight(unit: str, text: str, of_day_s: float) -> None:
    assert stamp_reader(unit)(text) == round(of_day_s * 1e9)


@pytest.mark.parametrize(
    ("unit", "text"),
    [("dmy", "13/13/2024 10:00:00"), ("mdy", "13/01/2024 10:00:00"), ("clock", "10:60:00"),
     ("clock", "24:00:00"), ("clock", "13:00:00 PM"), ("hhmmss", "096100"), ("hhmmss", "1234567"),
     ("hhmmss", "-1"), ("dmy", "1.3.2024 lunch"), ("dmy", "1.3.024 10:00:00"), ("days1900", "x"),
     ("ymd", "2024/03-01 12:00:00"), ("dmy", "1-Fog-2024 10:00:00"),
     ("mdy", "1-Mar-2024 10:00:00"), ("s", "1e400")],
)  # fmt: skip
def test_what_is_no_time_is_none(unit: str, text: str) -> None:
    assert stamp_reader(unit)(text) is None


def test_decimal_commas_and_every_unit() -> None:
    assert stamp_reader("hhmmss", ",")("100000,5") == 36_000_500_000_000
    assert stamp_reader("days1900", ",")("45352,5") == NOON_NS
    for unit in UNITS:
        assert stamp_reader(unit)("") is None


def test_midnight_begins_the_next_day_and_a_step_back_does_not() -> None:
    late, early = DAY_NS - 10**9, 10**9
    assert days_counted([late, None, early, early - 5]) == [
        late, None, DAY_NS + early, DAY_NS + early - 5,
    ]  # fmt: skip


def test_a_time_of_before_midnight_that_comes_late_is_of_the_day_before() -> None:
    late, early = DAY_NS - 10**9, 10**9
    assert days_counted([late, early, late + 5, early + 5]) == [
        late, DAY_NS + early, late + 5, DAY_NS + early + 5,
    ]  # fmt: skip


def test_a_zone_is_told_or_not() -> None:
    assert tells_zone("2024-03-01T10:00:00+01:00")
    assert tells_zone("10:00:00 UTC")
    assert not tells_zone("2024-03-01T10:00:00")
