"""Parquet whose pages carry checksums, which every reader here verifies.

Without them a byte that flips inside a page is a wrong number that nobody notices. Files without
checksums, of other writers, are read as they are.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

VERIFIED: dict[str, Any] = {"page_checksum_verification": True}
"""What readers of Arrow are told."""


def parquet_writer(sink: Any, schema: pa.Schema) -> pq.ParquetWriter:
    """Return a writer into a path or a sink."""
    return pq.ParquetWriter(sink, schema, compression="zstd", write_page_checksum=True)


def parquet_file(source: Any) -> pq.ParquetFile:
    """Open a path or a source; OSError or pa.ArrowException where it, or what is then read of it,
    is damaged."""
    return pq.ParquetFile(source, **VERIFIED)


def read_parquet(path: Path, columns: Sequence[str] | None = None) -> pa.Table:
    """Return the rows of a file, or of all files of a folder, with some columns or all; raises
    OSError or pa.ArrowException where they are damaged."""
    return pq.read_table(path, columns=None if columns is None else list(columns), **VERIFIED)
