"""A byte that flips in a page of a table is no other number."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from foretwin.sim_worker.futures.checked_parquet import parquet_file, parquet_writer, read_parquet

ROWS = pa.table(
    {
        "future_id": [f"f{n}" for n in range(40)],
        "min_clearance_m": np.linspace(0.1, 9.0, 40),
        "collided": [n % 3 == 0 for n in range(40)],
    }
)


def written(file: Path) -> bytes:
    with parquet_writer(file, ROWS.schema) as writer:
        writer.write_table(ROWS)
    return file.read_bytes()


def pages(file: Path) -> range:
    """Where the pages lie; the file's end, which tells of them, is parsed and not checked."""
    group = pq.read_metadata(file).row_group(0)
    columns = [group.column(n) for n in range(group.num_columns)]
    last = columns[-1]
    begin = last.dictionary_page_offset or last.data_page_offset
    return range(4, begin + last.total_compressed_size)


def test_no_byte_of_a_page_flips_unnoticed(tmp_path: Path) -> None:
    file = tmp_path / "futures.parquet"
    data, noticed = written(file), 0
    for place in pages(file):
        file.write_bytes(data[:place] + bytes([data[place] ^ 0x10]) + data[place + 1 :])
        try:
            assert read_parquet(file).equals(ROWS), place
        except (OSError, pa.ArrowException):
            noticed += 1

    assert noticed > 0.85 * len(pages(file))


@pytest.mark.parametrize("columns", [["min_clearance_m"], ["collided", "future_id"], None])
def test_rows_come_back_as_they_were(tmp_path: Path, columns: list[str] | None) -> None:
    file = tmp_path / "futures.parquet"
    written(file)

    assert read_parquet(file, columns).equals(ROWS.select(columns or ROWS.column_names))
    with parquet_file(file) as opened:
        assert opened.read(columns).equals(read_parquet(file, columns))


def test_tables_of_other_writers_are_read(tmp_path: Path) -> None:
    pq.write_table(ROWS, tmp_path / "other.parquet")

    assert read_parquet(tmp_path / "other.parquet").equals(ROWS)
