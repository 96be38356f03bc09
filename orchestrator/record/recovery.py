"""A run that ended badly, made readable: tables up to their last whole record, what was recorded,
and run.json."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable, Container, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import pyarrow as pa

from foretwin.contracts import trace
from foretwin.contracts.errors import UserError, one_line
from foretwin.contracts.local_bus import BUS
from foretwin.contracts.process import is_held
from foretwin.contracts.segments import DRIVE_FILE, segments_of
from foretwin.orchestrator.record.derive import derive, streams_in
from foretwin.orchestrator.record.durable import WRITING, sync_folder
from foretwin.orchestrator.record.kept_parts import read_removed
from foretwin.orchestrator.record.kept_rows import kept_rows
from foretwin.orchestrator.record.recovered_record import recovered_record
from foretwin.orchestrator.record.results import TABLES
from foretwin.orchestrator.record.run_state import (
    LOG,
    PROCESSES,
    RECORD,
    RESULTS,
    RUNNING,
    is_unfinished,
    read_record,
    run_lock,
    write_record,
)
from foretwin.orchestrator.record.so_far import forget_so_far
from foretwin.orchestrator.record.table_parts import parts_of_table
from foretwin.orchestrator.record.table_stream import SUFFIX, TableStream, record_bytes
from foretwin.orchestrator.runner.supervisor import fold_stderr
from foretwin.sim_worker.futures.checked_parquet import parquet_file
from foretwin.telemetry.logs.mend_mcap import look_through, mend

RECOVERED = "recovered"
"""The `exit` of a run that did not come to an end of its own, and what says of it what is lost."""
LEAVE_S = 20.0
"""How long the other processes of a drive may take to leave once its orchestrator is gone: their
grace, and what they then still write."""
_LOOK_S = 0.1


class Part(NamedTuple):
    """What became of one part of a run, in words, and whether something of it is lost."""

    text: str
    lost: bool = False


class Recovery(NamedTuple):
    """A run's `exit` and its parts; `healthy` where there was nothing to do.

    `record` is what run.json says now.
    """

    exit_word: str
    parts: tuple[Part, ...]
    healthy: bool
    record: Mapping[str, Any]

    @property
    def lost(self) -> list[str]:
        """What is lost, in words."""
        return [part.text for part in self.parts if part.lost]


class JudgedWindows(Protocol):
    """What the windows of a run were judged to."""

    @property
    def record(self) -> dict[str, Any]:
        """The `agreement` of run.json."""

    @property
    def rows(self) -> Sequence[Mapping[str, Any]]:
        """The rows of the table `agreement`."""


def recover(
    run: Path, *, judge: Callable[[Path], JudgedWindows | None] = lambda _: None
) -> Recovery:
    """Make readable what a run left; a healthy run is left as it is.

    `judge` judges the windows of a run that was killed before it could.

    Can be done again after an interruption, with the same outcome. Raises UserError for a folder
    that is none of a run, for a drive that still runs, and where nothing can be written: then what
    was there is still there.
    """
    results = run / RESULTS
    if not results.is_dir():
        gone = f"its {RESULTS}/ is gone" if (run / RECORD).exists() else "no folder of a run"
        raise UserError(f"{run}: {gone}")
    with run_lock(run):
        record = read_record(run)
        _let_leave(run)
        torn = [file for file in segments_of(run / DRIVE_FILE) if not look_through(file).ended]
        if record and not is_unfinished(run) and not torn:
            parts = (*_in_parquet(results), *_gone_recording(run, record))
            healthy = not any(part.lost for part in parts)
            return Recovery(str(record.get("exit")), parts, healthy, record)
        try:
            _begin_tables(results)
            judged = judge(run) if record.get("exit", RUNNING) == RUNNING else None
            if judged is not None:
                _keep_verdicts(results, judged.rows)
            streams = streams_in(results)
            recordings = map(_mended, segments_of(run / DRIVE_FILE))
            there = _in_parquet(results, but={stream.stem for stream in streams})
            parts = (*there, *_derived(results), *recordings, *_gone_recording(run, record))
            agreement = None if judged is None else judged.record
            record = _completed(run, record, parts, agreement, torn=bool(torn))
            write_record(record, run / RECORD)
            forget_so_far(run)
            for stream in streams:
                stream.unlink()
            fold_stderr(run / PROCESSES, run / LOG)
            shutil.rmtree(run / PROCESSES / BUS, ignore_errors=True)
            if (run / trace.TRACE_PARTS).is_dir():
                trace.joined(run / trace.TRACE_PARTS, run / trace.TRACE)
        except OSError as error:
            raise UserError(f"{run}: cannot be recovered: {one_line(error)}") from error
    return Recovery(str(record["exit"]), parts, healthy=False, record=record)


def _begin_tables(results: Path) -> None:
    """Begin the tables of a run that was killed before it had begun them all: rounds come last."""
    if any(file.stat().st_size for file in results.glob("rounds*")):
        return
    for name, columns in TABLES.items():
        stream = results / f"{name}{SUFFIX}"
        if not (stream.exists() and stream.stat().st_size):
            TableStream(stream, columns).close()


def _let_leave(run: Path) -> None:
    """Wait for the processes of a drive whose orchestrator is gone; UserError where they stay."""
    deadline = time.monotonic() + LEAVE_S
    while left := [file.stem for file in (run / PROCESSES).glob("*.json") if is_held(file)]:
        if time.monotonic() > deadline:
            raise UserError(f"{run}: {' and '.join(sorted(left))} of the drive still runs")
        time.sleep(_LOOK_S)


def _derived(results: Path) -> Iterator[Part]:
    """Make Parquet of the streams, which stay."""
    for partial in results.glob(f"*{WRITING}"):
        partial.unlink()
    for stream in streams_in(results):
        table = derive(stream)
        if table.rows is None:
            yield Part(f"{table.name}: lost: not even its columns are whole", lost=True)
        elif table.torn_bytes:
            torn = f"a torn end of {table.torn_bytes} bytes is lost"
            yield Part(f"{table.name}: {table.rows} rows; {torn}", lost=True)
        else:
            yield Part(f"{table.name}: {table.rows} rows")
    sync_folder(results)


def _in_parquet(results: Path, *, but: Container[str] = ()) -> Iterator[Part]:
    """Tell of the tables that are in Parquet already; older runs do not have all of today's."""
    parts = [part for name in TABLES for part in parts_of_table(results / f"{name}.parquet")]
    for file in (part for part in parts if part.stem not in but):
        try:
            with parquet_file(file) as table:
                rows = sum(batch.num_rows for batch in table.iter_batches())
            yield Part(f"{file.stem}: {rows} rows, as they were")
        except OSError as error:
            yield Part(f"{file.stem}: lost: {one_line(error)}", lost=True)
        except pa.ArrowException:
            yield Part(f"{file.stem}: lost: {file.name} is cut off or damaged", lost=True)


def _gone_recording(run: Path, record: Mapping[str, Any]) -> Iterator[Part]:
    """Tell where a drive recorded its car and no part of that is there, nor was put away."""
    telemetry = (record.get("ledger") or {}).get("telemetry") or {}
    if telemetry.get("recorded") and not (segments_of(run / DRIVE_FILE) or read_removed(run)):
        yield Part(f"{DRIVE_FILE}: lost: it is gone", lost=True)


def _mended(file: Path) -> Part:
    found = mend(file)
    if not found.data_bytes:
        return Part(f"{file.name}: lost: nothing of it is whole", lost=True)
    text = f"{file.name}: {found.messages} messages, up to stamp {found.last_ns} ns"
    if found.torn_bytes:
        return Part(f"{text}; a torn end of {found.torn_bytes} bytes is lost", lost=True)
    return Part(text)


def _keep_verdicts(results: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Append the rows of `agreement` to its stream, where it has none."""
    stream = results / f"agreement{SUFFIX}"
    if not stream.exists() or kept_rows(results, "agreement", "round_id"):
        return
    writer = TableStream(stream, TABLES["agreement"])
    try:
        batch = pa.RecordBatch.from_pylist(list(rows), schema=TABLES["agreement"])
        writer.append(record_bytes(batch))
        writer.sync()
    finally:
        writer.close()


def _completed(
    run: Path,
    record: dict[str, Any],
    parts: tuple[Part, ...],
    agreement: dict[str, Any] | None,
    *,
    torn: bool,
) -> dict[str, Any]:
    """Return the record of a run as far as it is known."""
    before = (record.get(RECOVERED) or {}).get("lost", ())
    lost = list(dict.fromkeys([*before, *(part.text for part in parts if part.lost)]))
    if record.get("exit", RUNNING) != RUNNING:
        return record | {RECOVERED: {"lost": lost}}
    known = recovered_record(run, record, agreement=agreement, torn=torn)
    words = {"lost": lost, "unknown": list(known.unknown), "told_until_s": known.told_until_s}
    return known.record | {"exit": RECOVERED, RECOVERED: words}
