"""Tables in parts are read as one."""

from __future__ import annotations

from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from foretwin.orchestrator.record.table_parts import (
    next_part,
    parts_of_table,
    put_away_name,
    read_parts,
    table_of,
)


def test_parts_are_read_in_the_order_in_which_they_were_written(tmp_path: Path) -> None:
    last = tmp_path / "events.parquet"
    for first in range(12):
        name = last if first == 11 else next_part(last)
        pq.write_table(pa.table({"n": [first], "m": [0]}), name)
    pq.write_table(pa.table({"n": [99]}), tmp_path / "events-more.parquet")
    assert [path.name for path in parts_of_table(last)][-3:] == [
        "events-010.parquet", "events-011.parquet", "events.parquet",
    ]  # fmt: skip
    assert read_parts(last, columns=["n"]).to_pydict() == {"n": list(range(12))}
    put_away_name(last, 1).unlink()  # more than is kept
    assert read_parts(last)["n"].to_pylist() == list(range(1, 12))


def test_a_table_that_is_not_there_is_said_to_be_missing(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        read_parts(tmp_path / "events.parquet")


def test_a_name_tells_its_table() -> None:
    assert table_of(Path("plan_comparisons-012.parquet")) == "plan_comparisons"
    assert table_of(Path("plan_comparisons.parquet")) is None
    assert table_of(Path("events-12.parquet")) is None
