"""Copies of a real run as if they were others: with ids, days, vehicles, maps and numbers of their
own."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

DAYS, VEHICLES, MAPS = 10, 5, 2
"""Among so many the copies are shared out."""
_HASHES = "job_sha256", "sha256", "trajectory_sha256", "future_id"


def copies_of(run: Path, out: Path, count: int) -> list[Path]:
    """Write copies of a finished run below a folder; returns theirs."""
    record = json.loads((run / "run.json").read_text(encoding="utf-8"))
    tables = {path.name: pq.read_table(path) for path in (run / "results").glob("*.parquet")}
    return [_copy(record, tables, out, number) for number in range(count)]


def _copy(record: dict, tables: dict[str, pa.Table], out: Path, number: int) -> Path:  # type: ignore[type-arg]
    day, rest = number % DAYS, number // DAYS
    run_id = f"202611{day + 1:02d}-{number:06d}-c0de"
    folder = out / run_id
    (folder / "results").mkdir(parents=True)
    own_map = hashlib.sha256(f"{rest // VEHICLES % MAPS}".encode()).hexdigest()
    said = record | {
        "run_id": run_id,
        "config": record["config"] | {"vehicle_id": f"car-{rest % VEHICLES}"},
        "map": record["map"] | {"sha256": own_map},
    }
    (folder / "run.json").write_text(json.dumps(said), encoding="utf-8")
    for name, table in tables.items():
        pq.write_table(_changed(table, number), folder / "results" / name, compression="zstd")
    return folder


def _changed(table: pa.Table, number: int) -> pa.Table:
    for place, field in enumerate(table.schema):
        column = table.column(place)
        if field.type == pa.float64():
            column = pc.multiply(column, 1.0 + number * 1e-4)
        elif field.name in _HASHES:
            column = pa.chunked_array([_others(column.to_pylist(), number)], pa.string())
        table = table.set_column(place, field, column)
    return table


def _others(values: list[str | None], number: int) -> list[str | None]:
    return [
        None if one is None else hashlib.sha256(f"{number} {one}".encode()).hexdigest()[: len(one)]
        for one in values
    ]
