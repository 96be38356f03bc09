"""The tables of jobs and of all that became of them: one schema for drives and sweeps."""

from __future__ import annotations

import json
import platform
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pyarrow as pa

from foretwin.contracts.codec import write_message
from foretwin.contracts.futures import Job
from foretwin.contracts.job_identity import JobBytes, vehicle_digest
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.orchestrator.record.versions import versions
from foretwin.sim_worker.futures.future_rows import FUTURE_COLUMNS, Row
from foretwin.sim_worker.metrics.table import METRICS, ROW_METRICS

_TYPES = {
    bool: pa.bool_(), int: pa.int64(), float: pa.float64(), str: pa.string(),
    bytes: pa.binary(), dict: pa.map_(pa.string(), pa.float64()),
}  # fmt: skip

RESULT_SCHEMA_VERSION = 1
"""Of these tables: raised where a column means something else."""
VEHICLES, REPEATED = "vehicles", "repeated"
"""Folders of a run or sweep: parameters that jobs name, and pictures of futures played again."""


SWEPT_TABLES = {"road_users": "road_users", "jobs": "jobs", "futures": "rows"}
"""Folders of the parts of a sweep's tables; whose futures are there is done, so these are written
last."""
METRICS_FILE = "metrics.parquet"
"""A sweep's table of what its metrics mean."""


def table_at(folder: Path, table: str) -> Path:
    """Return the file of a run's or sweep's table, or the folder of a sweep's.

    Raises FileNotFoundError where there is none.
    """
    swept = {"metrics": METRICS_FILE, **SWEPT_TABLES}.get(table)
    places = [folder / "results" / f"{table}.parquet", *([folder / swept] if swept else [])]
    for path in places:
        if path.exists():
            return path
    raise FileNotFoundError(f"{folder}: holds no table of {table}, neither of a run nor a sweep")


def _schema(**columns: type) -> pa.Schema:
    return pa.schema([(name, _TYPES[kind]) for name, kind in columns.items()])


JOB_TABLES = {
    "futures": _schema(**FUTURE_COLUMNS),
    "road_users": _schema(
        job_sha256=str, name=str, kind=str, x_m=float, y_m=float, yaw_rad=float, speed_mps=float,
        length_m=float, width_m=float,
    ),
    "jobs": _schema(
        job_sha256=str, round_id=int, job_index=int, stamp_ns=int, world_id=str, vehicle=str,
        vehicle_version=int, futures=int, engine=str, job=bytes,
    ),
    "metrics": _schema(name=str, unit=str, better=str),
}  # fmt: skip
"""Futures, the road users that all futures of a job share, jobs as they can be played again, and
what the metrics of futures mean."""


def job_row(job: Job, recorded: JobBytes) -> Row:
    """Return the row of a job."""
    return {
        "job_sha256": recorded.sha256, "round_id": job.round_id, "job_index": job.job_index,
        "stamp_ns": job.state.stamp_ns, "world_id": job.world_id, "vehicle": job.vehicle,
        "vehicle_version": job.vehicle_version, "futures": len(job.futures),
        "engine": job.engine, "job": recorded.data,
    }  # fmt: skip


def road_user_rows(job: Job, job_sha256: str) -> list[Row]:
    """Return the rows of those who are in every future of a job, as they begin."""
    rows: list[Row] = []
    for there in job.replayed:
        x, y, yaw = (float(value) for value in there.poses[0])
        length, width = there.size_m or (None, None)
        rows.append({
            "name": f"recorded {there.user_id}", "kind": there.kind, "x_m": x, "y_m": y,
            "yaw_rad": yaw, "speed_mps": float(there.speed_mps[0]), "length_m": length,
            "width_m": width,
        })  # fmt: skip
    rows += [
        {
            "name": f"seen {seen.user_id}", "kind": seen.kind, "x_m": seen.x_m, "y_m": seen.y_m,
            "yaw_rad": seen.yaw_rad, "speed_mps": seen.speed_mps, "length_m": seen.length_m,
            "width_m": seen.width_m,
        }
        for seen in job.road_users
    ]  # fmt: skip
    return [{"job_sha256": job_sha256, **row} for row in rows]


def metric_rows() -> list[Row]:
    """Return what the columns `metric_…` of futures mean."""
    return [
        {"name": name, "unit": METRICS[name].unit, "better": METRICS[name].better}
        for name in ROW_METRICS
    ]


def processor() -> str:
    """Return what this machine computes with, in words."""
    try:
        told = Path("/proc/cpuinfo").read_text(encoding="utf-8")
    except OSError:
        told = ""
    models = (line.split(":", 1)[1] for line in told.splitlines() if line.startswith("model name"))
    return f"{platform.machine()} {next(models, platform.processor()).strip()}".strip()


def played_with() -> dict[str, str]:
    """Return, as metadata of tables, what their numbers came from besides the jobs."""
    return {
        "result_schema": str(RESULT_SCHEMA_VERSION),
        "versions": json.dumps(versions()),
        "processor": processor(),
    }


def keep_vehicles(folder: Path, vehicles: Iterable[VehicleParameters]) -> None:
    """Write parameters into a run's or sweep's folder, under the digests that jobs name."""
    (folder / VEHICLES).mkdir(parents=True, exist_ok=True)
    for vehicle in vehicles:
        write_message(vehicle, folder / VEHICLES / f"{vehicle_digest(vehicle)}.vehicle")


def as_table(name: str, rows: list[Row], metadata: dict[str, str]) -> Any:
    """Return rows as a table of `JOB_TABLES`."""
    schema = JOB_TABLES[name].with_metadata(metadata)
    return pa.Table.from_pylist(rows, schema=schema)
