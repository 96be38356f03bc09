"""Rows of a run's tables as far as they are written: whole parts, and streams that still grow."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pyarrow as pa

from foretwin.orchestrator.record.table_parts import parts_of_table
from foretwin.orchestrator.record.table_stream import SUFFIX, StreamReader
from foretwin.sim_worker.futures.checked_parquet import read_parquet


def kept_rows(results: Path, table: str, *columns: str) -> list[dict[str, Any]]:
    """Return the rows of a table, or the named columns of them, the oldest first.

    Parts that cannot be read have none. A part that is both a stream and Parquet counts once.
    """
    streams = parts_of_table(results / f"{table}{SUFFIX}")
    whole = parts_of_table(results / f"{table}.parquet")
    parts = {part.stem: part for part in (*whole, *streams)}
    last = parts.pop(table, None)
    # As they are numbered; the last one has no number.
    inorder = [parts[stem] for stem in sorted(parts, key=lambda stem: (len(stem), stem))]
    return [
        row for part in (*inorder, *([last] if last else [])) for row in _rows(part, list(columns))
    ]


def _rows(part: Path, columns: list[str]) -> Iterator[dict[str, Any]]:
    try:
        if part.suffix == SUFFIX:
            for record in StreamReader(part).records():
                yield from (record.select(columns) if columns else record).to_pylist()
        else:
            yield from read_parquet(part, columns or None).to_pylist()
    except (OSError, pa.ArrowException):
        return
