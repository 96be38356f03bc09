"""Jobs of a run or sweep as they were recorded, and what it takes to play them again."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any, NamedTuple

import pyarrow as pa
import pyarrow.parquet as pq

from foretwin.contracts.codec import SchemaMismatch, read_message
from foretwin.contracts.errors import UserError
from foretwin.contracts.futures import Job
from foretwin.contracts.job_identity import job_from_bytes
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.contracts.world import World
from foretwin.orchestrator.record.job_tables import (
    RESULT_SCHEMA_VERSION,
    VEHICLES,
    processor,
    table_at,
)
from foretwin.orchestrator.record.versions import versions
from foretwin.sim_worker.world_file import load_world

_DECIDE = ("python", "foretwin", "mujoco", "numpy", "scipy", "numba")
"""Versions without which a job may come to other bits."""


class RecordedFuture(NamedTuple):
    """A future's row, its job, and the World and vehicle that it was played with."""

    row: dict[str, Any]
    job: Job
    world: World
    vehicle: VehicleParameters


def recorded_future(folder: Path, future_id: str) -> RecordedFuture:
    """Return a future of a run or sweep by its id.

    Raises FileNotFoundError, or UserError in one line, where it is not there or was recorded with
    what is not here: another schema, other versions, another processor.
    """
    row = _row(table_at(folder, "futures"), "future_id", future_id)
    asked = _row(table_at(folder, "jobs"), "job_sha256", row["job_sha256"])
    if hashlib.sha256(asked["job"]).hexdigest() != row["job_sha256"]:
        raise UserError(f"{folder}: the job of {future_id} is damaged: its hash is another one")
    try:
        job = job_from_bytes(asked["job"], where=f"{folder}: the job of {future_id}")
        world = load_world(folder / "worlds", job.world_id)
        file = folder / VEHICLES / f"{job.vehicle}.vehicle"
        return RecordedFuture(row, job, world, read_message(file, VehicleParameters))
    except SchemaMismatch as error:
        raise UserError(str(error)) from error


def _row(path: Path, column: str, value: str) -> dict[str, Any]:
    try:
        schema = pq.ParquetDataset(path).schema
        _check_same(path, schema)
        found = pq.read_table(path, filters=[(column, "=", value)]).to_pylist()
    except (OSError, pa.ArrowException) as error:
        raise UserError(f"{path}: cannot be read: {error}") from error
    if not found:
        raise UserError(f"{path}: no {column} {value!r}")
    row: dict[str, Any] = found[0]
    return row


def _check_same(path: Path, schema: pa.Schema) -> None:
    """Raise UserError where a table was written with what may come to other bits."""
    said = {key.decode(): value.decode() for key, value in (schema.metadata or {}).items()}
    if said.get("result_schema") != str(RESULT_SCHEMA_VERSION):
        raise UserError(
            f"{path}: written by another foretwin (schema of results "
            f"{said.get('result_schema', 'not told')}; this one reads {RESULT_SCHEMA_VERSION})"
        )
    then, now = json.loads(said["versions"]), versions()
    for name in _DECIDE:
        if then.get(name) != now[name]:
            raise UserError(
                f"{path}: recorded with {name} {then.get(name)}, here is {now[name]}: bits may "
                "differ"
            )
    if said["processor"] != processor():
        raise UserError(
            f"{path}: recorded on {said['processor']}, this is {processor()}: bits may differ"
        )
