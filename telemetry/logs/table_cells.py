"""The cells of a table file as texts, column by column: separated values, or Parquet."""

from __future__ import annotations

import csv
from collections.abc import Collection
from pathlib import Path
from typing import NamedTuple

from foretwin.telemetry.logs.log import LogError

Cells = list[str]

PARQUET_MAGIC = b"PAR1"


class CellTable(NamedTuple):
    """Texts by column, each as long as there are whole rows, and how many rows were cut short."""

    cells: dict[str, Cells]
    short_rows: int


def is_parquet(path: Path) -> bool:
    """Tell whether a file is a Parquet table, by its content."""
    with path.open("rb") as file:
        return file.read(len(PARQUET_MAGIC)) == PARQUET_MAGIC


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
        return CellTable(_parquet_cells(path, wanted, declared_in), 0)
    with path.open(encoding="utf-8-sig", errors="replace", newline="") as text:
        reader = csv.reader(text, delimiter=delimiter)
        first = next(reader, [])
        names = [name.strip() for name in first] if header else names_without_header(len(first))
        _check(path, wanted, names, declared_in)
        places = {name: names.index(name) for name in wanted}
        cells: dict[str, Cells] = {name: [] for name in wanted}
        kept = [(cells[name].append, place) for name, place in places.items()]
        width, short = len(names), 0
        if not header:
            for add, place in kept:
                add(first[place])
        for row in reader:
            if not any(map(str.strip, row)):
                continue
            if len(row) < width:
                short += 1
                continue
            for add, place in kept:
                add(row[place])
    return CellTable(cells, short)


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
