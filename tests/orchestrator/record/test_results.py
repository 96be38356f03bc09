"""The tables: every row lands in its file, and a disk that fails is said, never raised."""

from __future__ import annotations

import threading
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from foretwin.orchestrator.record.results import QUEUE_DEPTH, TABLES, ResultTables


def event(number: int) -> dict[str, object]:
    return {"stamp_ns": number, "level": "info", "source": "test", "text": f"event {number}"}


def test_rows_are_written_in_order_with_their_origin(tmp_path: Path) -> None:
    metadata = {"attribution": "© OpenStreetMap contributors"}
    tables = ResultTables(tmp_path, metadata, lossless=True)
    for number in range(5000):
        tables.add("events", [event(number)])
    tables.close()
    assert (tables.dropped, tables.failed) == (0, None)
    table = pq.read_table(tmp_path / "events.parquet")
    assert table["stamp_ns"].to_pylist() == list(range(5000))
    assert table.schema.metadata[b"attribution"].decode() == "© OpenStreetMap contributors"


def test_a_live_drive_is_never_held_up(tmp_path: Path) -> None:
    tables = ResultTables(tmp_path, {})
    tables.close()  # nobody empties the queue any more
    for number in range(QUEUE_DEPTH + 5):
        tables.add("events", [event(number)])
    assert tables.dropped == 5


def test_every_table_exists_even_when_empty(tmp_path: Path) -> None:
    ResultTables(tmp_path, {}).close()
    assert {file.stem for file in tmp_path.glob("*.parquet")} == set(TABLES)
    assert pq.read_table(tmp_path / "futures.parquet").num_rows == 0


def test_a_row_that_no_table_holds_is_said(tmp_path: Path) -> None:
    tables = ResultTables(tmp_path, {})
    tables.add("events", [event(2**70)])
    tables.close()
    assert tables.failed is not None
    assert "results cannot be written: OverflowError" in tables.failed
    assert pq.read_table(tmp_path / "rounds.parquet").num_rows == 0


def test_results_that_take_too_long_are_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    disk_answers = threading.Event()
    write = pq.ParquetWriter.write_table
    monkeypatch.setattr(
        pq.ParquetWriter, "write_table", lambda *what: disk_answers.wait() and write(*what)
    )
    tables = ResultTables(tmp_path, {})
    tables.add("events", [event(1)])
    tables.close(0.2)
    assert tables.failed == "results were not written within 0.2 s"
    disk_answers.set()
    tables.close()
    assert pq.read_table(tmp_path / "events.parquet").num_rows == 1


def test_a_disk_that_cannot_be_written_is_said(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    folder = tmp_path / "results"
    folder.mkdir()
    (folder / "rounds.parquet").mkdir()  # where a file should be
    tables = ResultTables(folder, {})
    tables.add("events", [event(1)])
    tables.close()
    assert tables.failed is not None
    assert "results cannot be written" in tables.failed
