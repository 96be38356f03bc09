"""A small table, and streams of it, for tests of what a kill leaves."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pyarrow as pa

from foretwin.orchestrator.record.table_stream import StreamReader, TableStream, record_bytes

SCHEMA = pa.schema(
    [("number", pa.int64()), ("name", pa.string()), ("values", pa.map_(pa.string(), pa.float64()))]
).with_metadata({"run_id": "r1"})


def rows(first: int, count: int) -> list[dict[str, Any]]:
    return [
        {"number": n, "name": None if n % 3 else f"row {n}", "values": [("x", n / 7)] * (n % 2)}
        for n in range(first, first + count)
    ]


def write(path: Path, sizes: Sequence[int]) -> list[int]:
    """Write a stream of records with so many rows each, numbered through; returns where its head
    and each of its records end."""
    stream, first, ends = TableStream(path, SCHEMA), 0, [path.stat().st_size]
    for count in sizes:
        batch = pa.RecordBatch.from_pylist(rows(first, count), schema=SCHEMA)
        stream.append(record_bytes(batch))
        first += count
        ends.append(path.stat().st_size)
    stream.close()
    return ends


def read(path: Path) -> list[dict[str, Any]]:
    return [row for batch in StreamReader(path).records() for row in batch.to_pylist()]
