"""The tables: every row lands in its file, and a disk that fails is said, never raised."""

from __future__ import annotations

import threading
import time
from itertools import pairwise
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from foretwin.orchestrator.keep import Keep
from foretwin.orchestrator.record import results as module
from foretwin.orchestrator.record.results import QUEUE_DEPTH, TABLES, ResultTables
from foretwin.orchestrator.record.run_streams import RunStreams
from foretwin.orchestrator.record.table_parts import parts_of_table, read_parts
from foretwin.orchestrator.record.table_stream import StreamReader
from tests.starvation import kept_waiting
from tests.system.foretwin_command import wait_for


def event(number: int) -> dict[str, object]:
    return {"stamp_ns": number, "level": "info", "source": "test", "text": f"event {number}"}


def test_rows_are_written_in_order_with_their_origin(tmp_path: Path) -> None:
    metadata = {"attribution": "© OpenStreetMap contributors"}
    tables = ResultTables(tmp_path, metadata, lossless=True)
    for number in range(5000):
        tables.add("events", [event(number)])
    tables.close()
    assert (tables.dropped, tables.troubles) == (0, [])
    table = pq.read_table(tmp_path / "events.parquet")
    assert table["stamp_ns"].to_pylist() == list(range(5000))
    assert table.schema.metadata[b"attribution"].decode() == "© OpenStreetMap contributors"


def test_while_the_run_goes_on_a_row_is_in_its_file_within_a_second(tmp_path: Path) -> None:
    def there() -> bool:
        path = tmp_path / "events.arrows"
        return path.exists() and any(rows.num_rows for rows in StreamReader(path).records())

    tables = ResultTables(tmp_path, {})
    with kept_waiting() as kept:
        tables.add("events", [event(1)])
        assert wait_for(there, "the row") < 1.0 + kept.seconds
    assert not list(tmp_path.glob("*.parquet"))
    tables.close()
    assert not list(tmp_path.glob("*.arrows"))


def test_rows_wait_for_the_next_write_and_not_every_write_is_synced(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    written: list[tuple[float, bool]] = []
    write = RunStreams.write
    tables: ResultTables | None = None

    def noted(streams: RunStreams, *, sync: bool) -> None:
        if tables is not None and streams is tables._streams:  # others may not have been closed
            written.append((time.monotonic(), sync))
        write(streams, sync=sync)

    monkeypatch.setattr(RunStreams, "write", noted)
    monkeypatch.setattr(module, "WRITE_S", 0.05)
    monkeypatch.setattr(module, "SYNC_S", 0.1)
    tables = ResultTables(tmp_path, {})

    def synced_thrice() -> bool:
        assert tables is not None
        tables.add("events", [event(1)])
        return sum(sync for _, sync in written) >= 3

    wait_for(synced_thrice, "three syncs")
    tables.close()
    *before, (_, last) = written
    assert not last  # Parquet is
    assert all(b - a > 0.045 for (a, _), (b, _) in pairwise(before))
    synced = [at for at, sync in before if sync]
    assert all(b - a > 0.07 for a, b in pairwise(synced))


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


def test_a_row_that_no_table_holds_costs_itself_alone(tmp_path: Path) -> None:
    tables = ResultTables(tmp_path, {})
    tables.add("events", [event(1), event(2**70), event(3)])
    tables.add("touches", [{"stamp_ns": 4, "one": "twin", "other": "ghost"}])
    tables.close()

    (trouble,) = tables.troubles
    assert trouble.startswith("1 rows are lost: the table of events cannot hold them: Overflow")
    assert tables.dropped == 1
    assert pq.read_table(tmp_path / "events.parquet")["stamp_ns"].to_pylist() == [1, 3]
    assert pq.read_table(tmp_path / "touches.parquet").num_rows == 1


def test_results_that_take_too_long_are_said_and_stay(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    disk_answers = threading.Event()
    write = pq.ParquetWriter.write_table
    monkeypatch.setattr(
        pq.ParquetWriter, "write_table", lambda *what: disk_answers.wait() and write(*what)
    )
    tables = ResultTables(tmp_path / "results", {})
    tables.add("events", [event(1)])
    stream = tmp_path / "results" / "events.arrows"

    def written() -> bool:
        found = StreamReader(stream).records() if stream.is_file() else ()
        return bool(sum(rows.num_rows for rows in found) == 1)

    wait_for(written, "the row in its stream")
    tables.close(0.2)
    (trouble,) = tables.troubles
    assert "nothing was written for 0.2 s" in trouble
    assert f"foretwin recover {tmp_path}" in trouble
    assert written()

    disk_answers.set()
    tables.close()
    assert pq.read_table(tmp_path / "results" / "events.parquet").num_rows == 1


def test_a_stream_that_cannot_be_written_is_said_and_the_others_are(tmp_path: Path) -> None:
    (tmp_path / "rounds.arrows").mkdir()  # where a file should be
    tables = ResultTables(tmp_path, {})
    tables.add("events", [event(1)])
    tables.add("rounds", [{"round_id": 1}])
    tables.close()

    assert tables.take_news()[0].startswith("results cannot be written now, and wait: IsADir")
    assert any("1 rows are lost: they could not be written: IsADir" in t for t in tables.troubles)
    assert pq.read_table(tmp_path / "events.parquet").num_rows == 1


def test_where_parquet_has_no_room_the_streams_stay(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def no_room(*_: object) -> None:
        raise OSError(28, "No space left on device")

    tables = ResultTables(tmp_path / "results", {})
    tables.add("events", [event(1)])
    with monkeypatch.context() as patched:
        patched.setattr(pq.ParquetWriter, "write_table", no_room)
        tables.close()

    (trouble,) = tables.troubles
    assert trouble.startswith("not in Parquet: events, metrics: OSError: [Errno 28] No space left")
    assert trouble.endswith(f"`foretwin recover {tmp_path}` makes it of what was written")
    assert {path.name for path in (tmp_path / "results").glob("*.arrows")} == {
        "events.arrows", "metrics.arrows",
    }  # fmt: skip
    assert not list((tmp_path / "results").glob("*.writing"))


def test_a_day_of_rows_is_put_away_in_parts_and_read_as_one_table(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "LOOK_EVERY_S", 0.0)
    monkeypatch.setattr(module, "SYNC_S", 0.0)
    monkeypatch.setattr(module, "WRITE_S", 0.01)
    keep = Keep(total_bytes=1e6)
    tables, last = (
        ResultTables(tmp_path / "results", {}, keep=keep),
        tmp_path / "results/events.parquet",
    )
    number = 0

    def three_parts() -> bool:
        nonlocal number
        for _ in range(100):
            tables.add("events", [event(number)])
            number += 1
        return len(parts_of_table(last)) > 3

    wait_for(three_parts, "three parts")
    assert not list((tmp_path / "results").glob("*.writing"))
    tables.close()
    assert tables.troubles == []
    assert tables.dropped == 0
    assert read_parts(last)["stamp_ns"].to_pylist() == list(range(number))
    assert len(parts_of_table(tmp_path / "results/rounds.parquet")) == 1, "no part without a row"


def test_parts_that_are_more_than_is_kept_go_while_the_run_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "LOOK_EVERY_S", 0.0)
    monkeypatch.setattr(module, "SYNC_S", 0.0)
    monkeypatch.setattr(module, "WRITE_S", 0.01)
    tables = ResultTables(tmp_path / "results", {}, keep=Keep(hours=1e-4))  # 0.36 s
    number = 0

    def gone() -> bool:
        nonlocal number
        tables.add("events", [event(number)])
        number += 1
        return (tmp_path / "removed.json").exists()

    wait_for(gone, "a part that goes")
    tables.close()
    assert tables.take_news() == ["the oldest parts of the run go from here on, as --keep says"]
    left = read_parts(tmp_path / "results/events.parquet")["stamp_ns"].to_pylist()
    assert 0 < len(left) < number
    assert left == list(range(number - len(left), number))
