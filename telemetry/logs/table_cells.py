"""The cells of a table file as texts, column by column: separated values, or Parquet."""

from __future__ import annotations

import codecs
import csv
import itertools
import os
from collections import Counter
from collections.abc import Collection, Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

from foretwin.telemetry.logs.log import LogError

Cells = list[str]

PARQUET_MAGIC = b"PAR1"
BLANKS = " "
"""The delimiter that stands for any run of blanks and tabs."""
_HEAD_BYTES = 1 << 16


class CellTable(NamedTuple):
    """Texts by column, each as long as there are whole rows, how many rows were cut short or are
    lost in a cell of another, and whether the last line was left out because it has no end: digits
    of it may be missing."""

    cells: dict[str, Cells]
    short_rows: int = 0
    open_end: bool = False


def is_parquet(path: Path) -> bool:
    """Tell whether a file is a Parquet table, by its content."""
    with path.open("rb") as file:
        return file.read(len(PARQUET_MAGIC)) == PARQUET_MAGIC


def encoding_of(path: Path) -> str:
    """Return in which encoding a text is: UTF-16 by its mark, UTF-8, else that of Windows."""
    with path.open("rb") as file:
        head = file.read(_HEAD_BYTES)
    if head.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16"
    try:
        # A character may be cut where the head ends.
        codecs.getincrementaldecoder("utf-8-sig")().decode(head)
    except UnicodeDecodeError:
        return "cp1252"
    return "utf-8-sig"


def rows_of(lines: Iterable[str], delimiter: str) -> Iterator[list[str]]:
    """Yield the cells of each line."""
    if delimiter == BLANKS:
        return (line.split() for line in lines)
    return csv.reader(lines, delimiter=delimiter)


def whole_lines(text: str) -> str:
    """Return a text without its last line where that has no end."""
    return text[: 1 + max(text.rfind("\n"), text.rfind("\r"))]


def names_without_header(count: int) -> list[str]:
    """Return what the columns of a table without names are called: c1, c2, …"""
    return [f"c{number}" for number in range(1, count + 1)]


def names_apart(names: Iterable[str]) -> list[str]:
    """Return names of columns without blanks around them; of equal ones all but the first numbered.

    The second `v` is called `v (2)`.
    """
    seen: Counter[str] = Counter()
    found = []
    for name in map(str.strip, names):
        seen[name] += 1
        found.append(name if seen[name] == 1 else f"{name} ({seen[name]})")
    return found


def read_cells(
    path: Path,
    *,
    wanted: Collection[str],
    declared_in: str,
    delimiter: str,
    header: bool,
    skip_lines: int = 0,
) -> CellTable:
    """Read the wanted columns of a table, whose names stand after `skip_lines` lines.

    Without `header` the columns are called c1, c2, …. Raises LogError naming a column that
    `declared_in` names and the table lacks.
    """
    if is_parquet(path):
        return CellTable(_parquet_cells(path, wanted, declared_in))
    try:
        return _separated_cells(path, wanted, declared_in, delimiter, header, skip_lines)
    except csv.Error as error:
        what = f"{path}: {error}: a quotation mark may be opened there and never closed"
        raise LogError(what) from None


def _separated_cells(
    path: Path,
    wanted: Collection[str],
    declared_in: str,
    delimiter: str,
    header: bool,
    skip_lines: int,
) -> CellTable:
    encoding = encoding_of(path)
    with path.open(encoding=encoding, errors="replace", newline="") as text:
        reader = rows_of(itertools.islice(text, skip_lines, None), delimiter)
        first = next(reader, [])
        names = names_apart(first) if header else names_without_header(len(first))
        _check(path, wanted, names, declared_in)
        places = {name: names.index(name) for name in wanted}
        cells: dict[str, Cells] = {name: [] for name in wanted}
        kept = [(cells[name].append, place) for name, place in places.items()]
        width, short = len(names), 0
        rows: Iterable[list[str]] = reader if header else itertools.chain([first], reader)
        open_end = not _ends_its_last_line(path, encoding)
        if open_end:
            rows = _all_but_last(rows)
        for row in rows:
            if not any(map(str.strip, row)):
                continue
            if len(row) < width:
                short += 1 + _lines_in(row)
                continue
            for add, place in kept:
                add(row[place])
    short += sum(map(_lines_in, cells.values()))
    return CellTable(cells, short, open_end)


def _lines_in(cells: Iterable[str]) -> int:
    """Return how many lines a quotation mark that is never closed has made part of some cells."""
    return sum(cell.rstrip("\r\n").count("\n") for cell in cells)


def _ends_its_last_line(path: Path, encoding: str) -> bool:
    with path.open("rb") as file:
        file.seek(-2 if encoding == "utf-16" else -1, os.SEEK_END)
        return file.read().strip(b"\0") in (b"\n", b"\r")


def _all_but_last(rows: Iterable[list[str]]) -> Iterator[list[str]]:
    for row, _ in itertools.pairwise(rows):
        yield row


def _parquet_cells(path: Path, wanted: Collection[str], declared_in: str) -> dict[str, Cells]:
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        table = pq.ParquetFile(path)
        _check(path, wanted, list(table.schema_arrow.names), declared_in)
        read = table.read(columns=list(wanted))
        return {name: _texts(read.column(name)) for name in wanted}
    except (OSError, pa.ArrowException) as error:
        raise LogError(f"{path}: no Parquet table that can be read: {error}") from error


def _texts(column: object) -> Cells:
    import pyarrow as pa
    import pyarrow.compute as pc

    assert isinstance(column, pa.ChunkedArray)
    return [text or "" for text in pc.cast(column, pa.string()).to_pylist()]


def _check(path: Path, wanted: Collection[str], names: list[str], declared_in: str) -> None:
    missing = sorted(set(wanted) - set(names))
    if missing:
        raise LogError(
            f"{path}: line 1: no column {missing[0]!r}, which {declared_in} declares;"
            f" columns: {', '.join(names)}"
        )
