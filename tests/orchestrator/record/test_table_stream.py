"""Streams: what is whole is read, to the row, wherever a file is cut or damaged."""

from __future__ import annotations

import errno
import os
import tempfile
from pathlib import Path

import pyarrow as pa
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.orchestrator.record.table_stream import StreamReader, TableStream, record_bytes
from tests.orchestrator.record.tables_for_streams import SCHEMA, read, rows, write

SIZES = st.lists(st.integers(1, 9), max_size=6)


def whole_part(ends: list[int], cut: int) -> int:
    """Return how many records end before a place, -1 where not even the head does."""
    return sum(end <= cut for end in ends) - 1


def test_any_arrow_reads_a_stream(tmp_path: Path) -> None:
    write(tmp_path / "a", [3, 1, 5])
    table = pa.ipc.open_stream((tmp_path / "a").read_bytes()).read_all()

    assert [row["number"] for row in table.to_pylist()] == list(range(9))
    assert table.schema.metadata == {b"run_id": b"r1"}


@given(SIZES, st.data())
def test_a_stream_cut_at_any_byte_holds_exactly_the_whole_records_before_it(
    sizes: list[int], data: st.DataObject
) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "a")
        ends = write(path, sizes)
        cut = data.draw(st.integers(0, ends[-1]), label="cut")
        os.truncate(path, cut)
        records = whole_part(ends, cut)
        reader = StreamReader(path)

        assert read(path) == rows(0, sum(sizes[: max(records, 0)]))
        assert (reader.schema is None) == (records < 0)
        assert len(list(reader.records())) == max(records, 0)
        assert reader.whole_bytes == (ends[records] if records >= 0 else 0)


def test_every_cut_of_one_stream(tmp_path: Path) -> None:
    path = tmp_path / "a"
    ends = write(path, [2, 4])
    whole = path.read_bytes()
    for cut in range(len(whole) + 1):
        path.write_bytes(whole[:cut])
        assert read(path) == rows(0, (0, 0, 2, 6)[whole_part(ends, cut) + 1]), cut


@given(SIZES.filter(bool), st.data())
def test_damage_in_a_record_ends_the_stream_before_it(
    sizes: list[int], data: st.DataObject
) -> None:
    """As after a power cut, where some of the last pages never came to the disk."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "a")
        ends = write(path, sizes)
        at = data.draw(st.integers(ends[0], ends[-1] - 1), label="at")
        length = data.draw(st.integers(1, 4096), label="length")
        damaged = bytearray(path.read_bytes())
        kind = data.draw(st.sampled_from(["zeros", "other"]), label="kind")
        stretch = damaged[at : at + length]
        other = bytes(len(stretch)) if kind == "zeros" else bytes(b ^ 0x5A for b in stretch)
        damaged[at : at + length] = other
        path.write_bytes(damaged)
        changed = next((at + i for i, b in enumerate(stretch) if b != other[i]), ends[-1])

        assert read(path) == rows(0, sum(sizes[: whole_part(ends, changed)]))


@given(SIZES, st.data())
def test_who_goes_on_with_a_torn_stream_appends_to_its_whole_part(
    sizes: list[int], data: st.DataObject
) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "a")
        ends = write(path, sizes)
        cut = data.draw(st.integers(0, ends[-1]), label="cut")
        os.truncate(path, cut)
        before = read(path)
        stream = TableStream(path, SCHEMA)
        stream.append(record_bytes(pa.RecordBatch.from_pylist(rows(100, 2), schema=SCHEMA)))
        stream.sync()
        stream.close()

        assert read(path) == before + rows(100, 2)


def test_a_full_disk_costs_no_record_that_is_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a"
    write(path, [3])
    stream = TableStream(path, SCHEMA)
    really = os.pwrite
    left = [100]

    def little_room(descriptor: int, data: bytes, at: int) -> int:
        if not left[0]:
            raise OSError(errno.ENOSPC, "No space left on device")
        written = really(descriptor, data[: left[0]], at)
        left[0] -= written
        return written

    record = record_bytes(pa.RecordBatch.from_pylist(rows(3, 2), schema=SCHEMA))
    monkeypatch.setattr(os, "pwrite", little_room)
    with pytest.raises(OSError, match="No space"):
        stream.append(record)
    assert read(path) == rows(0, 3)
    left[0] = 10_000_000
    stream.append(record)
    stream.close()

    assert read(path) == rows(0, 5)


def test_a_table_with_other_columns_is_not_appended_to(tmp_path: Path) -> None:
    write(tmp_path / "a", [3])
    with pytest.raises(FileExistsError, match="other columns"):
        TableStream(tmp_path / "a", pa.schema([("something", pa.int64())]))
    assert read(tmp_path / "a") == rows(0, 3)
