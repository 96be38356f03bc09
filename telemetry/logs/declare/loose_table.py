"""A table of which nothing is declared: its columns as numbers, as far as they are some."""

from __future__ import annotations

import csv
import io
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv as pacsv
import pyarrow.parquet as pq

from foretwin.contracts.arrays import Array, Stamps
from foretwin.telemetry.logs.gpx import stamp_ns_from_iso
from foretwin.telemetry.logs.log import LogError
from foretwin.telemetry.logs.table_cells import (
    is_parquet,
    names_without_header,
    whole_lines,
)

_DELIMITERS = (";", "\t", ",", "|")
"""A semicolon first: with it commas are decimal."""
_LINES_LOOKED_AT = 50
_LEAST_ROWS = 20
_NUMBERS = 0.5
"""So many of a column's filled cells are numbers, else it is a text."""


class LooseTable(NamedTuple):
    """Columns (N,) by name, NaN where a cell is empty or no number; stamps of those that are times.

    `texts` are the columns that are neither.
    """

    path: Path
    delimiter: str
    decimal: Literal[".", ","]
    header: bool
    columns: dict[str, Array]
    times: dict[str, Stamps]
    texts: tuple[str, ...]

    @property
    def rows(self) -> int:
        """How many rows there are."""
        return len(next(iter((self.columns or self.times).values())))


def read_loose_table(path: Path) -> LooseTable:
    """Read a table of numbers; raises LogError where the file is none."""
    if is_parquet(path):
        try:
            table, shape = pq.read_table(path), _Shape(",", ".", True)
        except (OSError, pa.ArrowException) as error:
            raise LogError(f"{path}: no Parquet table that can be read: {error}") from error
    else:
        text = whole_lines(path.read_bytes().decode("utf-8-sig", errors="replace"))
        try:
            shape = _shape(path, text)
            table = _parsed(path, text, *shape)
        except csv.Error as error:
            raise LogError(f"{path}: no table of text: {error}") from error
    columns: dict[str, Array] = {}
    times: dict[str, Stamps] = {}
    texts = []
    for name, column in zip(table.column_names, table.columns, strict=True):
        numbers = _numbers(column, shape.decimal)
        if numbers is not None:
            columns[name] = numbers
        elif (stamps_ns := _stamps(column)) is not None:
            times[name] = stamps_ns
        else:
            texts.append(name)
    if table.num_rows < _LEAST_ROWS or not columns:
        raise LogError(
            f"{path}: no table of a drive: {table.num_rows} rows, {len(columns)} columns of numbers"
            f" (separated by {shape.delimiter!r}); a drive has {_LEAST_ROWS} rows and more"
        )
    return LooseTable(path, *shape, columns, times, tuple(texts))


class _Shape(NamedTuple):
    """How values are separated, and whether the first line names the columns."""

    delimiter: str
    decimal: Literal[".", ","]
    header: bool


def _shape(path: Path, text: str) -> _Shape:
    lines = text[: 1 << 16].splitlines()[:_LINES_LOOKED_AT]
    if len(lines) < 2:
        raise LogError(f"{path}: no table: {len(lines)} lines")
    for delimiter in _DELIMITERS:
        widths = {len(row) for row in csv.reader(lines[1:-1] or lines[1:], delimiter=delimiter)}
        if len(widths) == 1 and max(widths) > 1:
            break
    else:
        delimiter = max(_DELIMITERS, key=lambda sign: sum(line.count(sign) for line in lines))
    rows = list(csv.reader(lines, delimiter=delimiter))
    cells = [cell for row in rows[1:] for cell in row]
    comma = delimiter != "," and any(
        _is_number(cell.replace(",", ".")) for cell in cells if cell.count(",") == 1
    )
    decimal: Literal[".", ","] = "," if comma else "."
    header = not any(_is_number(cell.replace(decimal, ".")) for cell in rows[0])
    return _Shape(delimiter, decimal, header)


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _parsed(path: Path, text: str, delimiter: str, decimal: str, header: bool) -> pa.Table:
    first = next(csv.reader(io.StringIO(text), delimiter=delimiter))
    names = [name.strip() for name in first] if header else names_without_header(len(first))
    if len(set(names)) < len(names):
        doubled = next(name for name in names if names.count(name) > 1)
        raise LogError(f"{path}: line 1: two columns are called {doubled!r}; name them apart")
    try:
        return pacsv.read_csv(
            pa.BufferReader(text.encode()),
            read_options=pacsv.ReadOptions(column_names=names, skip_rows=int(header)),
            parse_options=pacsv.ParseOptions(
                delimiter=delimiter, invalid_row_handler=lambda _: "skip"
            ),
            convert_options=pacsv.ConvertOptions(decimal_point=decimal, strings_can_be_null=True),
        )
    except (pa.ArrowException, ValueError) as error:
        raise LogError(f"{path}: no table that can be read: {error}") from error


def _numbers(column: pa.ChunkedArray, decimal: str) -> Array | None:
    kind = column.type
    if pa.types.is_integer(kind) or pa.types.is_floating(kind):
        return np.asarray(pc.cast(column, pa.float64(), safe=False).to_numpy(), dtype=np.float64)
    if not pa.types.is_string(kind):
        return None
    cells = column.to_pylist()
    filled = sum(bool(cell and cell.strip()) for cell in cells)
    numbers = np.array([_number(cell, decimal) for cell in cells])
    return numbers if np.isfinite(numbers).sum() > _NUMBERS * max(filled, 1) else None


def _number(cell: str | None, decimal: str) -> float:
    try:
        return float((cell or "nan").replace(decimal, "."))
    except ValueError:
        return np.nan


def _stamps(column: pa.ChunkedArray) -> Stamps | None:
    """Return the stamps of a column of dates and times, the earliest there is where one is none."""
    if pa.types.is_timestamp(column.type):
        # Naive ones are UTC, as in ISO 8601 texts.
        return np.asarray(pc.cast(column, pa.timestamp("ns")).to_numpy().astype("int64"))
    if not pa.types.is_string(column.type):
        return None
    cells = column.to_pylist()
    if stamp_ns_from_iso(str(cells[0]).strip()) is None:
        return None
    found = [stamp_ns_from_iso((cell or "").strip()) for cell in cells]
    return np.array([np.iinfo(np.int64).min if one is None else one for one in found])
