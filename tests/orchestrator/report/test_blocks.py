"""Numbers and words as they stand in a report."""

from __future__ import annotations

import math

import pytest

from foretwin.orchestrator.report.blocks import (
    UNKNOWN,
    TableCell,
    change_between,
    listed_words,
    number,
    plural,
    power,
    scientific,
)


def test_what_is_not_known_is_no_number() -> None:
    for cell in (number(None), number(math.nan), scientific(None)):
        assert (cell.text, cell.order) == (UNKNOWN, None)
    assert number(0.0, 1, "s") == ("0.0\u00a0s", 0.0, "", "", False)


@pytest.mark.parametrize(
    ("value", "said"),
    [(0.0, "0"), (0.5, "0.5"), (7.92e-7, "7.9·10⁻⁷"), (1e-10, "1.0·10⁻¹⁰"), (9.99e-7, "1.0·10⁻⁶")],
)
def test_small_numbers_have_powers_of_ten(value: float, said: str) -> None:
    assert power(value) == said
    assert scientific(value).order == value


def test_words_are_counted_and_listed() -> None:
    assert plural(1, "future") == "1 future"
    assert plural(2752, "future") == "2\u202f752 futures"
    assert listed_words(()) == ""
    assert listed_words(("a", "b", "c")) == "a, b and c"


@pytest.mark.parametrize(
    ("first", "last", "said"),
    [
        (number(0.26, 2, "m"), number(0.331, 2, "m"), "+0.07\u00a0m"),
        (number(15744.0, 0), number(4064.0, 0), "-11680"),
        (number(6298.0, 0, "ms"), number(2344.0, 0, "ms"), "-3954\u00a0ms"),
        (number(1.0, 2, "m"), number(1.001, 2, "m"), "same"),
        (scientific(6.5e-6), scientific(1.2e-7), "-6.4·10⁻⁶"),
        (scientific(6.5e-6), scientific(0.0), "-6.5·10⁻⁶"),
        (scientific(0.0), scientific(0.5), "+0.5"),
        (number(None), number(1.0), UNKNOWN),
    ],
)
def test_a_change_is_written_as_what_changed(first: TableCell, last: TableCell, said: str) -> None:
    assert change_between(first, last).text == said
