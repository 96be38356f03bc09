"""Parquet tables from the streams that a run wrote."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import pyarrow as pa

from foretwin.orchestrator.record.durable import whole_file
from foretwin.orchestrator.record.table_stream import SUFFIX, StreamReader
from foretwin.sim_worker.futures.checked_parquet import parquet_writer

GROUP_ROWS, GROUP_JOBS = 2000, 128
"""Rows of a group of a Parquet file; those of jobs are large."""


class DerivedTable(NamedTuple):
    """What became of a stream: rows in Parquet, and bytes after its last whole record.

    `rows` is None where not even the columns are whole: there is no table then.
    """

    name: str
    rows: int | None
    torn_bytes: int


def streams_in(folder: Path) -> list[Path]:
    """Return the streams that lie in a folder of tables."""
    return sorted(folder.glob(f"*{SUFFIX}"))


def derive(stream: Path, *, each_group: Callable[[], None] = lambda: None) -> DerivedTable:
    """Write the whole records of a stream as Parquet beside it; the stream stays.

    Rows, columns and metadata are those of the stream, whatever its records; the same stream gives
    the same bytes. Raises OSError, or pa.ArrowException, where the table cannot be written.
    """
    reader = StreamReader(stream)
    if reader.schema is None:
        return DerivedTable(stream.stem, None, reader.total_bytes)
    rows = 0
    with (
        whole_file(stream.with_suffix(".parquet")) as partial,
        parquet_writer(partial, reader.schema) as writer,
    ):
        for group in _groups(reader, GROUP_JOBS if stream.stem == "jobs" else GROUP_ROWS):
            writer.write_table(group)
            rows += group.num_rows
            each_group()
    return DerivedTable(stream.stem, rows, reader.total_bytes - reader.whole_bytes)


def _groups(reader: StreamReader, size: int) -> Iterator[pa.Table]:
    """Yield rows in groups of `size`, the last one smaller."""
    waiting: list[pa.RecordBatch] = []
    for record in reader.records():
        waiting += [record] if record.num_rows else []
        while sum(one.num_rows for one in waiting) >= size:
            table = pa.Table.from_batches(waiting)
            yield table[:size].combine_chunks()
            waiting = table[size:].to_batches()
    if waiting:
        yield pa.Table.from_batches(waiting).combine_chunks()
