"""The tables of jobs and of all that became of them: one schema for drives and sweeps."""

from __future__ import annotations

import contextlib
import json
import platform
from collections.abc import Iterable
from pathlib import Path

import pyarrow as pa

from foretwin.contracts.codec import encode, write_message
from foretwin.contracts.futures import Job
from foretwin.contracts.job_identity import JobBytes, vehicle_digest
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.orchestrator.record.columns import columns, row_of, schema
from foretwin.orchestrator.record.table_parts import table_of
from foretwin.orchestrator.record.versions import versions
from foretwin.sim_worker.futures.future_rows import FUTURE_COLUMNS, Row
from foretwin.sim_worker.metrics.table import METRICS, ROW_METRICS

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
    """Return the last file of a run's or sweep's table, or the folder of a sweep's.

    Raises FileNotFoundError, naming those that are there, where there is none.
    """
    swept = {name: folder / at for name, at in (("metrics", METRICS_FILE), *SWEPT_TABLES.items())}
    of_run = {table_of(file) or file.stem for file in (folder / "results").glob("*.parquet")}
    there = {name: folder / "results" / f"{name}.parquet" for name in of_run}
    there = {name: path for name, path in swept.items() if path.exists()} | there
    if table not in there:
        known = f"holds {', '.join(sorted(there))}" if there else "neither of a run nor a sweep"
        raise FileNotFoundError(f"{folder}: holds no table of {table}: {known}")
    return there[table]


_PLACE = "kind:str x_m:float y_m:float yaw_rad:float speed_mps:float length_m:float width_m:float"
JOB_TABLES = {
    "futures": schema(FUTURE_COLUMNS),
    "road_users": schema(columns(f"job_sha256:str name:str {_PLACE}")),
    "jobs": schema(
        columns(
            "job_sha256:str round_id:int job_index:int stamp_ns:int world_id:str vehicle:str "
            "vehicle_version:int futures:int engine:str job:bytes"
        )
    ),
    "metrics": schema(columns("name:str unit:str better:str")),
}
"""Futures, the road users that all futures of a job share, jobs as they can be played again, and
what the metrics of futures mean."""


def job_row(job: Job, recorded: JobBytes) -> Row:
    """Return the row of a job."""
    return {
        **row_of(job, "round_id job_index world_id vehicle vehicle_version engine"),
        "job_sha256": recorded.sha256,
        "stamp_ns": job.state.stamp_ns,
        "futures": len(job.futures),
        "job": recorded.data,
    }


def road_user_rows(job: Job, job_sha256: str) -> list[Row]:
    """Return the rows of those who are in every future of a job, as they begin."""
    rows: list[Row] = []
    for there in job.replayed:
        speed_mps = float(there.speed_mps[0])
        place = (*there.poses[0].tolist(), speed_mps, *(there.size_m or (None, None)))
        values = f"recorded {there.user_id}", there.kind, *place
        rows.append(dict(zip(("name", *columns(_PLACE)), values, strict=True)))
    names = " ".join(columns(_PLACE))
    rows += [{"name": f"seen {one.user_id}", **row_of(one, names)} for one in job.road_users]
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
    """Write parameters into a run's or sweep's folder, under the digests that jobs name.

    Those that are there and whole stay as they are. Raises OSError.
    """
    (folder / VEHICLES).mkdir(parents=True, exist_ok=True)
    for vehicle in vehicles:
        file = folder / VEHICLES / f"{vehicle_digest(vehicle)}.vehicle"
        if not file.exists() or file.read_bytes() != encode(vehicle):
            write_message(vehicle, file)


class VehicleKeeper:
    """Keeps the parameters that a drive's jobs name; what a full disk does not take waits."""

    def __init__(self, folder: Path, vehicle: VehicleParameters) -> None:
        self._folder, self._waiting = folder, [vehicle]
        self.write()

    def add(self, vehicle: VehicleParameters) -> None:
        """Take parameters that jobs will name."""
        self._waiting.append(vehicle)
        self.write()

    def write(self) -> None:
        """Write what waits, where the disk takes it now; never raises."""
        if self._waiting:
            with contextlib.suppress(OSError):
                keep_vehicles(self._folder, self._waiting)
                self._waiting.clear()


def as_table(name: str, rows: list[Row], metadata: dict[str, str] | None = None) -> pa.Table:
    """Return rows as a table of `JOB_TABLES`."""
    return pa.Table.from_pylist(rows, schema=JOB_TABLES[name].with_metadata(metadata))
