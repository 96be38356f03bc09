"""Cells of an answer in SQL as other programs read them: in JSON, and in comma-separated values."""

from __future__ import annotations

import base64
import datetime
import decimal
from typing import Any

import msgspec


def json_cell(cell: Any) -> Any:
    """Return what JSON holds of a cell: blobs in base64, times in ISO 8601, intervals in seconds.

    Lists and maps stay what they are. Of a number that is infinite or none JSON makes null.
    """
    if isinstance(cell, dict):
        return {_key(name): json_cell(value) for name, value in cell.items()}
    if isinstance(cell, list | tuple):
        return [json_cell(value) for value in cell]
    if isinstance(cell, bytes | bytearray | memoryview):
        return base64.b64encode(cell).decode()
    if isinstance(cell, datetime.timedelta):
        return cell.total_seconds()
    if isinstance(cell, datetime.date | datetime.time):
        return cell.isoformat()
    if isinstance(cell, decimal.Decimal):
        return float(cell)
    return cell if cell is None or isinstance(cell, bool | int | float | str) else str(cell)


def csv_cell(cell: Any) -> Any:
    """Return a cell as one value of a line: as in JSON, and what is nested as its text in JSON."""
    if isinstance(cell, dict | list | tuple):
        return msgspec.json.encode(json_cell(cell)).decode()
    return cell if isinstance(cell, decimal.Decimal) else json_cell(cell)


def _key(name: Any) -> str:
    return str(csv_cell(name))
