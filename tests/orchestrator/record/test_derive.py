"""Parquet of streams: rows, columns, metadata and bytes as of a table written at once."""

from __future__ import annotations

import os
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.orchestrator.record.derive import GROUP_JOBS, GROUP_ROWS, derive, streams_in
from foretwin.sim_worker.futures.checked_parquet import parquet_writer
from tests.orchestrator.record.tables_for_streams import SCHEMA, rows, write


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("derived")


@given(sizes=st.lists(st.integers(0, 40), max_size=8))
def test_the_bytes_are_those_of_a_table_written_at_once(sizes: list[int], folder: Path) -> None:
    stream = folder / "events.arrows"
    stream.unlink(missing_ok=True)
    write(stream, sizes)
    at_once = pa.Table.from_pylist(rows(0, sum(sizes)), schema=SCHEMA)
    with parquet_writer(folder / "at_once", SCHEMA) as writer:
        if sum(sizes):
            writer.write_table(at_once)

    assert derive(stream) == ("events", sum(sizes), 0)
    assert (folder / "events.parquet").read_bytes() == (folder / "at_once").read_bytes()


@pytest.mark.parametrize(("table", "group"), [("futures", GROUP_ROWS), ("jobs", GROUP_JOBS)])
def test_groups_have_one_size_whatever_the_records(tmp_path: Path, table: str, group: int) -> None:
    write(tmp_path / f"{table}.arrows", [group - 1, 2, 3 * group, 5])
    derive(tmp_path / f"{table}.arrows")
    file = pq.ParquetFile(tmp_path / f"{table}.parquet")
    sizes = [file.metadata.row_group(i).num_rows for i in range(file.num_row_groups)]

    assert sizes == [group, group, group, group, 6]
    assert file.read()["number"].to_pylist() == list(range(4 * group + 6))
    assert file.schema_arrow.metadata == {b"run_id": b"r1"}


def test_a_torn_end_is_cut_and_counted_and_the_stream_stays(tmp_path: Path) -> None:
    stream = tmp_path / "events.arrows"
    ends = write(stream, [3, 4])
    os.truncate(stream, ends[1] + 7)

    assert derive(stream) == ("events", 3, 7)
    assert pq.read_table(tmp_path / "events.parquet").to_pylist() == rows(0, 3)
    assert streams_in(tmp_path) == [stream]


def test_nothing_is_made_where_not_even_the_columns_are_whole(tmp_path: Path) -> None:
    stream = tmp_path / "events.arrows"
    stream.write_bytes(b"\xff\xff")

    assert derive(stream) == ("events", None, 2)
    assert [path.name for path in tmp_path.iterdir()] == ["events.arrows"]


def test_a_table_that_cannot_be_written_leaves_nothing_half_made(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stream = tmp_path / "events.arrows"
    write(stream, [3])

    def no_room(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(pq.ParquetWriter, "write_table", no_room)
    with pytest.raises(OSError, match="No space"):
        derive(stream)
    assert [path.name for path in tmp_path.iterdir()] == ["events.arrows"]
