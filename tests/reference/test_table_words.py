"""Every table of a run says what a row is, and every column what it holds."""

from __future__ import annotations

import pytest

from foretwin.orchestrator.record.results import TABLES
from tests.reference.table_words import ROWS, meaning_of


def test_every_table_says_what_a_row_is() -> None:
    assert ROWS.keys() == TABLES.keys()


@pytest.mark.parametrize("table", sorted(TABLES))
def test_every_column_has_words(table: str) -> None:
    assert [name for name in TABLES[table].names if not meaning_of(table, name)] == []


def test_words_of_a_metric_name_its_unit() -> None:
    assert meaning_of("futures", "metric_ttc") == "metric ttc in s, higher is better"
    with pytest.raises(KeyError):
        meaning_of("futures", "metric_beauty")
