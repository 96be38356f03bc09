"""Rows are read the same from a stream that grows and from the table that it becomes."""

from __future__ import annotations

from pathlib import Path

from foretwin.orchestrator.record.derive import derive
from foretwin.orchestrator.record.kept_rows import kept_rows
from tests.orchestrator.record.tables_for_streams import rows, write


def test_rows_of_a_stream_and_of_its_table_are_the_same(tmp_path: Path) -> None:
    stream = tmp_path / "rounds.arrows"
    ends = write(stream, [3, 4])
    growing = kept_rows(tmp_path, "rounds")
    derive(stream)
    assert kept_rows(tmp_path, "rounds") == growing == rows(0, 7)
    stream.unlink()
    assert kept_rows(tmp_path, "rounds") == growing
    assert kept_rows(tmp_path, "rounds", "number") == [{"number": n} for n in range(7)]
    assert ends[-1] > ends[0]


def test_a_torn_end_and_a_missing_table_have_no_rows(tmp_path: Path) -> None:
    ends = write(tmp_path / "rounds.arrows", [3, 4])
    with (tmp_path / "rounds.arrows").open("r+b") as file:
        file.truncate(ends[-1] - 1)
    assert kept_rows(tmp_path, "rounds", "name") == [{"name": r["name"]} for r in rows(0, 3)]
    assert kept_rows(tmp_path, "futures") == []
    (tmp_path / "futures.parquet").write_text("no table")
    assert kept_rows(tmp_path, "futures") == []
