from __future__ import annotations

import datetime as dt
import decimal
from typing import Any

import pytest

from foretwin.orchestrator.across.plain_cells import csv_cell, json_cell

AT = dt.datetime(2026, 11, 23, 12, 0, 0, 500_000)


@pytest.mark.parametrize(
    ("cell", "in_json", "in_csv"),
    [
        (None, None, None),
        (True, True, True),
        (1.5, 1.5, 1.5),
        (b"\x00\xff", "AP8=", "AP8="),
        (dt.timedelta(days=1, milliseconds=250), 86400.25, 86400.25),
        (AT, "2026-11-23T12:00:00.500000", "2026-11-23T12:00:00.500000"),
        (AT.date(), "2026-11-23", "2026-11-23"),
        (decimal.Decimal("1.50"), 1.5, decimal.Decimal("1.50")),
        ({"a": b"\xff", "b": [AT.date()]}, {"a": "/w==", "b": ["2026-11-23"]},
         '{"a":"/w==","b":["2026-11-23"]}'),
        ([decimal.Decimal("0.5"), float("inf")], [0.5, float("inf")], "[0.5,null]"),
        ({b"\xff": 1}, {"/w==": 1}, '{"/w==":1}'),
    ],
)  # fmt: skip
def test_no_cell_is_spelt_as_python_spells_it(cell: Any, in_json: Any, in_csv: Any) -> None:
    assert json_cell(cell) == in_json
    assert csv_cell(cell) == in_csv
