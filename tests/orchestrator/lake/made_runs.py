"""Small folders as drives and sweeps leave them, and what a lake holds of them."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.dataset as ds
import pyarrow.parquet as pq

from foretwin.orchestrator.lake.manifest import MANIFEST
from foretwin.orchestrator.record.results import TABLES
from foretwin.orchestrator.record.run_folder import METRICS_FILE, SWEPT_TABLES
from foretwin.sim_worker.futures.checked_parquet import parquet_writer
from foretwin.sim_worker.futures.job_tables import JOB_TABLES

CREDIT = "© OpenStreetMap contributors"
TOLD = {"result_schema": "1", "attribution": CREDIT}
MAP_SHA256 = "5e87b1fe11c1f10938e1caeee57ea31b6f48b4bd6636b577341444bd15463b91"


def made_run(
    out: Path,
    number: int = 0,
    *,
    day: str = "20261123",
    vehicle_id: str = "ego",
    futures: int = 5,
    told: dict[str, str] = TOLD,
    **record: Any,
) -> Path:
    """Write a run with futures and rounds whose numbers are its own."""
    run_id = f"{day}-{number:06d}-abcd"
    folder = out / run_id
    (folder / "results").mkdir(parents=True)
    said = {
        "run_id": run_id, "exit": "completed", "seed": number,
        "map": {"file": "town.osm", "sha256": MAP_SHA256}, "config": {"vehicle_id": vehicle_id},
        **record,
    }  # fmt: skip
    (folder / "run.json").write_text(json.dumps(said))
    rows: dict[str, list[dict[str, Any]]] = {
        "futures": [future_row(number, index) for index in range(futures)],
        "rounds": [{"round_id": 1, "futures": futures}],
    }
    for name, schema in TABLES.items():
        write(folder / "results" / f"{name}.parquet", rows.get(name, []), schema, told)
    return folder


def made_sweep(folder: Path, *, jobs: int = 3, complete: bool = True, **more: Any) -> Path:
    """Write a sweep of so many jobs with two futures each."""
    for at in SWEPT_TABLES.values():
        (folder / at).mkdir(parents=True)
    for job in range(jobs):
        rows = [future_row(job, index) for index in range(2)]
        write(folder / "rows" / f"job-{job:06d}.parquet", rows, JOB_TABLES["futures"], TOLD)
        write(folder / "jobs" / f"job-{job:06d}.parquet", [{"job_sha256": str(job)}],
              JOB_TABLES["jobs"], TOLD)  # fmt: skip
    write(folder / METRICS_FILE, [{"name": "ttc", "unit": "s"}], JOB_TABLES["metrics"], TOLD)
    summary = {"fingerprint": "0cdb5ed7a3db79d9ff", "rows_sha256": "7f", "complete": complete,
               "spec": {"worlds": "there"}, **more}  # fmt: skip
    (folder / "sweep.json").write_text(json.dumps(summary))
    return folder


def future_row(number: int, index: int) -> dict[str, Any]:
    return {"future_id": f"{number}-{index}", "index": index, "end_x_m": number + index / 8.0,
            "values": [("gap_s", float(index))]}  # fmt: skip


def write(path: Path, rows: list[dict[str, Any]], schema: pa.Schema, told: dict[str, str]) -> None:
    table = pa.Table.from_pylist(rows, schema=schema.with_metadata(told))
    with parquet_writer(path, table.schema) as writer:
        writer.write_table(table)


def flip_a_byte(file: Path) -> None:
    """In the last page of `future_id`: other text, which could be read."""
    group = pq.read_metadata(file).row_group(0)
    columns = [group.column(n) for n in range(group.num_columns)]
    (column,) = (one for one in columns if one.path_in_schema == "future_id")
    begin = column.dictionary_page_offset or column.data_page_offset
    data = bytearray(file.read_bytes())
    data[begin + column.total_compressed_size - 1] ^= 0x01
    file.write_bytes(data)


def lake_table(lake: Path, table: str) -> pa.Table:
    """Read a table as any user of Arrow does, without the manifest."""
    if not (lake / table).is_dir():
        return pa.table({"run_id": pa.array([], pa.string())})
    return ds.dataset(lake / table, partitioning="hive").to_table()


def rows_by_run(lake: Path, table: str) -> Counter[str]:
    return Counter(lake_table(lake, table)["run_id"].to_pylist())


def contents(lake: Path) -> dict[str, bytes]:
    files = [path for path in lake.rglob("*") if path.is_file() and path.name != "collect.lock"]
    return {str(path.relative_to(lake)): path.read_bytes() for path in files}


def manifest_of(lake: Path) -> dict[str, Any]:
    told: dict[str, Any] = json.loads((lake / MANIFEST).read_bytes())
    return told
