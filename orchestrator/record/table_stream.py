"""A table that only grows while its run goes on: an Arrow IPC stream of records with checksums.

Any Arrow reads such a file up to its last whole record. Here a record counts as whole only where
its checksum is right, too: after a power cut a file may be long enough and hold zeros.
"""

from __future__ import annotations

import contextlib
import os
import time
import zlib
from collections.abc import Iterator
from pathlib import Path

import pyarrow as pa

SUFFIX = ".arrows"
"""Of Arrow's IPC streams."""
_CRC, _BLANK = b"crc32", b"--------"
_END_BYTES = 8
"""With which Arrow ends a stream. Not written here: who goes on with a stream appends to it."""
_BROKEN = (pa.ArrowException, OSError, EOFError, ValueError)
"""What Arrow raises over bytes that are no record, or no longer."""


class TableStream:
    """Appends records to a file, and goes on after the last whole one where there are some.

    Raises OSError where the file cannot be written: then it is as it was before that record.
    """

    def __init__(self, path: Path, schema: pa.Schema) -> None:
        self._descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
        self._unsynced = False
        self.begun_s = time.monotonic()
        self.empty_bytes = len(schema.serialize())
        try:
            self._whole_bytes = _whole_bytes(path, schema)
            os.ftruncate(self._descriptor, self._whole_bytes)
            if not self._whole_bytes:
                self.append(schema.serialize().to_pybytes())
        except BaseException:
            os.close(self._descriptor)
            raise

    def append(self, record: bytes) -> None:
        """Append what `record_bytes` made; a kill of this process leaves it in the file."""
        written = 0
        try:
            while written < len(record):
                written += os.pwrite(
                    self._descriptor, record[written:], self._whole_bytes + written
                )
        except OSError:
            os.ftruncate(self._descriptor, self._whole_bytes)
            raise
        self._whole_bytes += written
        self._unsynced = True

    @property
    def size_bytes(self) -> int:
        """How long the file is; `empty_bytes` where it holds no row."""
        return self._whole_bytes

    def sync(self) -> None:
        """Bring to the disk what was appended; then a power cut leaves it in the file, too."""
        if self._unsynced:
            os.fdatasync(self._descriptor)
            self._unsynced = False

    def close(self) -> None:
        """Close the file; what was not synced is left to the system."""
        os.close(self._descriptor)


class StreamReader:
    """Reads the whole records of a file; whatever stands in it, reading ends there and not before.

    `schema` is None where not even the columns are whole. Raises OSError where there is no file.
    """

    def __init__(self, path: Path) -> None:
        self.total_bytes = path.stat().st_size
        # What has no bytes cannot be mapped.
        self._data = (
            pa.memory_map(str(path)).read_buffer() if self.total_bytes else pa.py_buffer(b"")
        )
        self.schema: pa.Schema | None = None
        self.whole_bytes = 0
        """The length of what was whole so far: of all that is, once all `records` are read."""
        source = pa.BufferReader(self._data)
        with contextlib.suppress(*_BROKEN):
            self.schema = pa.ipc.read_schema(source)
            self.whole_bytes = source.tell()
        self._head = self._data[: self.whole_bytes].to_pybytes()

    def records(self) -> Iterator[pa.RecordBatch]:
        """Yield the rows of each whole record, in their order."""
        source = pa.BufferReader(self._data)
        while self.schema is not None:
            source.seek(self.whole_bytes)
            try:
                pa.ipc.read_message(source)
                rows = self._checked(self._data[self.whole_bytes : source.tell()].to_pybytes())
            except _BROKEN:
                return
            if rows is None:
                return
            self.whole_bytes = source.tell()
            yield rows

    def _checked(self, record: bytes) -> pa.RecordBatch | None:
        """Return the rows of a record, None where its checksum is another one."""
        stream = pa.ipc.open_stream(pa.BufferReader(self._head + record))
        rows, told = stream.read_next_batch_with_custom_metadata()
        crc = (told or {}).get(_CRC, b"")
        whole = len(crc) == len(_BLANK) and crc == _crc_of(record.replace(crc, _BLANK, 1))
        return rows if whole else None


def record_bytes(rows: pa.RecordBatch) -> bytes:
    """Return rows as a record, with the checksum of itself as it is while that is blank."""
    sink = pa.BufferOutputStream()
    with pa.ipc.new_stream(sink, rows.schema) as writer:
        writer.write_batch(rows, custom_metadata={_CRC: _BLANK})
    head_bytes = len(rows.schema.serialize())
    blank: bytes = sink.getvalue().to_pybytes()[head_bytes:-_END_BYTES]
    # The words beside a record stand before its rows: the first blank is the checksum's.
    return blank.replace(_BLANK, _crc_of(blank), 1)


def _crc_of(record: bytes) -> bytes:
    return b"%08x" % zlib.crc32(record)


def _whole_bytes(path: Path, schema: pa.Schema) -> int:
    """Return the length of a stream's whole part; OSError where it has other columns."""
    reader = StreamReader(path)
    if reader.schema is not None and not reader.schema.equals(schema):
        raise FileExistsError(f"{path}: holds a table with other columns")
    for _ in reader.records():
        pass
    return reader.whole_bytes
