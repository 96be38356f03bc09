"""A table of which nothing is declared: its columns as numbers, as far as they are some."""

from __future__ import annotations

import io
import itertools
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv as pacsv
import pyarrow.parquet as pq

from foretwin.contracts.arrays import Array, Stamps
from foretwin.telemetry.logs.declare.hemispheres import negated_by_letters
from foretwin.telemetry.logs.declare.layout import TextLayout, layout_of
from foretwin.telemetry.logs.log import LogError
from foretwin.telemetry.logs.table_cells import (
    BLANKS,
    encoding_of,
    is_parquet,
    names_apart,
    names_without_header,
    rows_of,
    whole_lines,
)
from foretwin.telemetry.logs.table_times import (
    CLOCK,
    TEXTS,
    days_counted,
    is_of_day,
    stamp_reader,
    tells_zone,
)
from foretwin.telemetry.logs.units import ISO_TIME

_LEAST_ROWS = 20
_NO_TIMES = 0.1
"""So many cells of a column of times may be none."""
_NEVER = "%Y-%m-%d-no-date"
_NUMBERS = 0.5
"""So many of a column's filled cells are numbers, else it is a text."""


class TimeTexts(NamedTuple):
    """A column of times: stamps (N,), in which of table_times.TEXTS, and whether it tells its zone.

    `date` is the column of its days, where that is another one; `either` tells that day and month
    could stand the other way round.
    """

    stamps_ns: Stamps
    unit: str
    zone: bool
    date: str | None = None
    either: bool = False


class LooseTable(NamedTuple):
    """Columns (N,) by name, NaN where a cell is empty or no number; stamps of those that are times.

    `texts` are the columns that are neither, with one of their cells. `negated` are columns
    whose sign was turned here, by the column of letters that says so.
    """

    path: Path
    layout: TextLayout
    columns: dict[str, Array]
    times: dict[str, TimeTexts]
    texts: dict[str, str]
    negated: dict[str, str]

    @property
    def rows(self) -> int:
        """How many rows there are."""
        return len(next(iter(self.columns.values())))

    @property
    def words_of_texts(self) -> str:
        """The columns that are no numbers, each with a cell of it."""
        return ", ".join(f"{name} (such as {cell})" for name, cell in self.texts.items() if cell)


def read_loose_table(path: Path) -> LooseTable:
    """Read a table of numbers; raises LogError where the file is none."""
    if is_parquet(path):
        try:
            table, layout = pq.read_table(path), TextLayout(",", ".", True, 0, 1)
        except (OSError, pa.ArrowException) as error:
            raise LogError(f"{path}: no Parquet table that can be read: {error}") from error
    else:
        # Line breaks of all kinds become one.
        text = whole_lines(path.read_text(encoding=encoding_of(path), errors="replace"))
        layout = layout_of(path, text)
        table = _parsed(path, text, layout)
    columns: dict[str, Array] = {}
    times: dict[str, TimeTexts] = {}
    texts: dict[str, str] = {}
    letters: dict[str, frozenset[str]] = {}
    cells: dict[str, list[str]] = {}
    for name, column in zip(table.column_names, table.columns, strict=True):
        numbers = _numbers(column, layout.decimal)
        if numbers is not None:
            columns[name] = numbers
        elif (said := _time_texts(column)) is not None:
            times[name] = said
            cells[name] = [str(cell or "") for cell in column.to_pylist()]
        else:
            filled = [
                text for cell in column.unique().to_pylist() if (text := str(cell or "").strip())
            ]
            texts[name] = next(iter(filled), "")
            letters[name] = frozenset(text.upper() for text in filled)
    times |= _with_dates(cells, times)
    if table.num_rows < _LEAST_ROWS or not columns:
        raise LogError(
            f"{path}: no table of a drive: {table.num_rows} rows, {len(columns)} columns of numbers"
            f" (separated by {layout.delimiter!r}); a drive has {_LEAST_ROWS} rows and more"
        )
    try:
        negated = negated_by_letters(table.column_names, columns, letters)
    except ValueError as error:
        raise LogError(f"{path}: {error}") from None
    columns |= {name: -columns[name] for name in negated}
    return LooseTable(path, layout, columns, times, texts, negated)


def _parsed(path: Path, text: str, layout: TextLayout) -> pa.Table:
    lines = itertools.islice(io.StringIO(text), layout.skip_lines, None)
    first = next(rows_of(lines, layout.delimiter))
    names = names_apart(first) if layout.header else names_without_header(len(first))
    delimiter = layout.delimiter
    if delimiter == BLANKS:
        delimiter, text = (
            "\t",
            "".join("\t".join(line.split()) + "\n" for line in io.StringIO(text)),
        )
    try:
        return pacsv.read_csv(
            pa.BufferReader(text.encode()),
            read_options=pacsv.ReadOptions(column_names=names, skip_rows=layout.rows_from),
            parse_options=pacsv.ParseOptions(
                delimiter=delimiter, invalid_row_handler=lambda _: "skip"
            ),
            convert_options=pacsv.ConvertOptions(
                decimal_point=layout.decimal,
                strings_can_be_null=True,
                # Dates stay texts: whether they name a zone is theirs to tell.
                timestamp_parsers=[_NEVER],
            ),
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


def _time_texts(column: pa.ChunkedArray) -> TimeTexts | None:
    """Return the stamps of a column of dates or times, the earliest there is where one is none."""
    if pa.types.is_timestamp(column.type):
        # Naive ones are UTC, as in ISO 8601 texts.
        stamps = pc.cast(column, pa.timestamp("ns")).to_numpy().astype("int64")
        return TimeTexts(np.asarray(stamps), ISO_TIME, column.type.tz is not None)
    return time_texts([str(cell or "") for cell in column.to_pylist()])


def time_texts(cells: Sequence[str]) -> TimeTexts | None:
    """Return the stamps of texts in the unit in which the first and most of them are times.

    Where day and month could stand either way, the month is first beside AM and PM alone.
    """
    first = next((cell for cell in cells if cell.strip()), "")
    found = {}
    for unit in TEXTS:
        stamp_of = stamp_reader(unit)
        if stamp_of(first) is None:
            continue
        stamps = [stamp_of(cell) for cell in cells]
        if sum(one is None for one in stamps) <= _NO_TIMES * len(stamps):
            found[unit] = days_counted(stamps) if is_of_day(unit) else stamps
    if not found:
        return None
    either = {"dmy", "mdy"} <= found.keys()
    unit = "mdy" if either and first.strip().lower().endswith("m") else next(iter(found))
    lacks = np.iinfo(np.int64).min
    stamps_ns = np.array([lacks if one is None else one for one in found[unit]], dtype=np.int64)
    return TimeTexts(stamps_ns, unit, tells_zone(first), either=either)


def _with_dates(columns: dict[str, list[str]], times: dict[str, TimeTexts]) -> dict[str, TimeTexts]:
    """Return times of the day that have a column of days beside them, read with it."""
    days = [name for name, said in times.items() if said.unit != CLOCK and _is_daily(said)]
    found = {}
    for name, said in times.items():
        if said.unit == CLOCK and days:
            pairs = zip(columns[days[0]], columns[name], strict=True)
            joined = time_texts([f"{day} {text}" for day, text in pairs])
            if joined is not None:
                found[name] = joined._replace(date=days[0])
    return found


def _is_daily(said: TimeTexts) -> bool:
    known = said.stamps_ns[said.stamps_ns > np.iinfo(np.int64).min]
    return bool(np.all(known % (86_400 * 10**9) == 0))
