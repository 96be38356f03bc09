"""The tables of jobs and of all that became of them: one schema for drives and sweeps."""

from __future__ import annotations

import json

import pyarrow as pa

from foretwin.contracts.arithmetic import arithmetic_sha256
from foretwin.contracts.futures import Job
from foretwin.contracts.job_identity import JobBytes
from foretwin.contracts.versions import processor, versions
from foretwin.sim_worker.futures.columns import RESULT_SCHEMA_VERSION, columns, row_of, schema
from foretwin.sim_worker.futures.future_rows import FUTURE_COLUMNS, Row
from foretwin.sim_worker.metrics.table import METRICS, ROW_METRICS

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


def played_with() -> dict[str, str]:
    """Return, as metadata of tables, what their numbers came from besides the jobs."""
    return {
        "result_schema": str(RESULT_SCHEMA_VERSION),
        "versions": json.dumps(versions()),
        "processor": processor(),
        "arithmetic": arithmetic_sha256(),
    }


def as_table(name: str, rows: list[Row], metadata: dict[str, str] | None = None) -> pa.Table:
    """Return rows as a table of `JOB_TABLES`."""
    return pa.Table.from_pylist(rows, schema=JOB_TABLES[name].with_metadata(metadata))
