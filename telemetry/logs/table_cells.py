"""The cells of a table file as texts, column by column: separated values, or Parquet."""

from __future__ import annotations

import csv
import itertools
import os
from collections.abc import Collection, Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

from foretwin.telemetry.logs.log import LogError

Cells = list[str]

PARQUET_MAGIC = b"PAR1"


class CellTable(NamedTuple):
    """Texts by column, each as long as there are whole rows, how many rows were cut short, and
    whether the last line was left out because it has no end: digits of it may be missing."""

    cells: dict[str, Cells]
    short_rows: int = 0
    open_end: bool = False


def is_parquet(path: Path) -> bool:
    """Tell whether a file is a Parquet table, by its content."""
    with path.open("rb") as file:
        return file.read(len(PARQUET_MAGIC)) == PARQUET_MAGIC


def whole_lines(text: str) -> str:
    """Return a text without its last line where that has no end."""
    return text[: 1 + max(text.rfind("\n"), text.rfind("\r"))]


def names_without_header(count: int) -> list[str]:
    """Return what the columns of a table without names are called: c1, c2, …"""
    return [f"c{number}" for number in range(1, count + 1)]


def read_cells(
    path: Path, *, wanted: Collection[str], declared_in: str, delimiter: str, header: bool
) -> CellTable:
    """Read the wanted columns of a table.

    Without `header` the columns are called c1, c2, …. Raises LogError naming a column that
    `declared_in` names and the table lacks.
    """
    if is_parquet(path):
        return CellTable(_parquet_cells(path, wanted, declared_in))
    with path.open(encoding="utf-8-sig", errors="replace", newline="") as text:
        reader = csv.reader(text, delimiter=delimiter)
        first = next(reader, [])
        names = [name.strip() for name in first] if header else names_without_header(len(first))
        _check(path, wanted, names, declared_in)
        places = {name: names.index(name) for name in wanted}
        cells: dict[str, Cells] = {name: [] for name in wanted}
        kept = [(cells[name].append, place) for name, place in places.items()]
        width, short = len(names), 0
        rows: Iterable[list[str]] = reader if header else itertools.chain([first], reader)
        open_end = not _ends_its_last_line(path)
        if open_end:
            rows = _all_but_last(rows)
        for row in rows:
            if not any(map(str.strip, row)):
                continue
            if len(row) < width:
                short += 1
                continue
            for add, place in kept:
                add(row[place])
    return CellTable(cells, short, open_end)


def _ends_its_last_line(path: Path) -> bool:
    with path.open("rb") as file:
        file.seek(-1, os.SEEK_END)
        return file.read() in (b"\n", b"\r")


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
