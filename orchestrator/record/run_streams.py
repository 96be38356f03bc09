"""The streams of a run: rows become records, wait where the disk takes none, and are counted."""

from __future__ import annotations

import logging
import time
from collections import Counter, defaultdict, deque
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import pyarrow as pa

from foretwin.contracts.errors import one_line
from foretwin.contracts.segments import Roll
from foretwin.orchestrator.record.durable import sync_folder
from foretwin.orchestrator.record.table_parts import next_part
from foretwin.orchestrator.record.table_stream import SUFFIX, TableStream, record_bytes

log = logging.getLogger("results")

WAITING_BYTES = 64 * 1024 * 1024
"""So much may wait for a disk that takes nothing; rows after that are lost, and counted."""

NAMED = {"futures": {"jobs"}, "road_users": {"jobs"}, "rounds": {"futures"}}
"""Tables whose rows say of which job or round they are, by those of them that come first."""

Rows = Sequence[Mapping[str, Any]]


class _WaitingRecord(NamedTuple):
    record: bytes
    rows: int


class RunStreams:
    """One stream for each table of `schemas`, in one folder; nothing here raises.

    What the disk does not take now is tried again at the next `write`. A stream that is there is
    gone on with; of a table that is in Parquet already nothing more is taken.
    """

    def __init__(self, folder: Path, schemas: Mapping[str, pa.Schema]) -> None:
        self._folder = folder
        done = {name for name in schemas if _is_done(folder, name)}
        self._schemas = {name: of for name, of in schemas.items() if name not in done}
        self._done = done
        self._streams: dict[str, TableStream] = {}
        self._rows: dict[str, list[Mapping[str, Any]]] = defaultdict(list)
        self._waiting: dict[str, deque[_WaitingRecord]] = defaultdict(deque)
        self._waiting_bytes = 0
        self.lost: Counter[str] = Counter()
        """Rows that no file will hold, by why."""
        self._refused: dict[str, str] = {}
        """Why a table could not hold the first of the rows that it could not hold."""
        self.failing: str | None = None
        """Why the disk took nothing the last time; None where it did."""

    def take(self, table: str, rows: Rows) -> None:
        """Take rows of a table; `write` writes them."""
        if table in self._done:
            self.lost["they came after their table was complete"] += len(rows)
        else:
            self._rows[table].extend(rows)

    def write(self, *, sync: bool) -> None:
        """Append what was taken; with `sync` a power cut leaves it, too."""
        for table, rows in self._rows.items():
            if rows:
                self._make_record(table, rows)
                rows.clear()
        self.failing = None
        # What others name comes first, jobs before futures, futures before rounds; where a disk
        # has room for the small ones alone, those who name what is not written wait, too.
        not_written: set[str] = set()
        for table in reversed(list(self._schemas)):
            if NAMED.get(table, set()) & not_written:
                not_written.add(table)
                continue
            try:
                self._append(table)
                if sync:
                    self._streams[table].sync()
            except OSError as error:
                not_written.add(table)
                self.failing = self.failing or one_line(error)

    def put_away(self, roll: Roll) -> list[Path]:
        """Put away what is large or old enough, and begin those tables anew; raises OSError.

        A kill at any moment leaves streams that can be read.
        """
        ended = []
        for table, stream in list(self._streams.items()):
            age_s = time.monotonic() - stream.begun_s
            if stream.size_bytes == stream.empty_bytes:
                continue
            if roll.is_due(size_bytes=stream.size_bytes, age_s=age_s):
                path = self._folder / f"{table}{SUFFIX}"
                stream.sync()
                stream.close()
                del self._streams[table]
                ended.append(path.rename(next_part(path)))
        return ended

    def close(self) -> None:
        """Close the files; rows that still wait are lost."""
        if waiting := sum(one.rows for records in self._waiting.values() for one in records):
            self.lost[f"they could not be written: {self.failing}"] += waiting
        self._waiting.clear()
        for stream in self._streams.values():
            stream.close()
        self._streams.clear()

    def _append(self, table: str) -> None:
        stream = self._stream(table)
        waiting = self._waiting[table]
        while waiting:
            stream.append(waiting[0].record)
            self._waiting_bytes -= len(waiting.popleft().record)

    def _stream(self, table: str) -> TableStream:
        if table not in self._streams:
            path = self._folder / f"{table}{SUFFIX}"
            self._streams[table] = TableStream(path, self._schemas[table])
            if len(self._streams) == len(self._schemas):
                sync_folder(self._folder)
        return self._streams[table]

    def _make_record(self, table: str, rows: Rows) -> None:
        batch = self._batch(table, rows)
        record = record_bytes(batch) if batch.num_rows else b""
        if self._waiting_bytes + len(record) > WAITING_BYTES:
            self.lost["they could not be written for so long that no more could wait"] += (
                batch.num_rows
            )
        elif record:
            self._waiting[table].append(_WaitingRecord(record, batch.num_rows))
            self._waiting_bytes += len(record)

    def _batch(self, table: str, rows: Rows) -> pa.RecordBatch:
        """Return rows as the table's columns hold them; without those that they cannot hold."""
        schema = self._schemas[table]
        try:
            return pa.RecordBatch.from_pylist(list(rows), schema=schema)
        except Exception:
            kept = [row for row in rows if self._fits(table, row)]
            return pa.RecordBatch.from_pylist(kept, schema=schema)

    def _fits(self, table: str, row: Mapping[str, Any]) -> bool:
        try:
            pa.RecordBatch.from_pylist([row], schema=self._schemas[table])
        except Exception as error:
            if table not in self._refused:
                log.exception("a row that the table of %s cannot hold", table)
                self._refused[table] = f"the table of {table} cannot hold them: {one_line(error)}"
            self.lost[self._refused[table]] += 1
            return False
        return True


def _is_done(folder: Path, table: str) -> bool:
    stream = folder / f"{table}{SUFFIX}"
    return stream.with_suffix(".parquet").exists() and not stream.exists()
