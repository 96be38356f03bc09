"""Jobs of a run or sweep as they were recorded, and what it takes to play them again."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import NamedTuple, TypeVar

import msgspec
import pyarrow as pa
import pyarrow.compute as pc

from foretwin.contracts.arithmetic import arithmetic_sha256
from foretwin.contracts.codec import SchemaMismatch, read_message
from foretwin.contracts.errors import UserError
from foretwin.contracts.futures import EngineName, Job
from foretwin.contracts.job_identity import future_id, job_from_bytes, vehicle_digest
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.contracts.versions import processor, versions
from foretwin.contracts.world import World
from foretwin.contracts.world_identity import with_id
from foretwin.orchestrator.record.kept_rows import kept_rows
from foretwin.orchestrator.record.result_files import check_result_schema, opened
from foretwin.orchestrator.record.run_folder import VEHICLES, table_at
from foretwin.orchestrator.record.run_state import RESULTS, check_finished
from foretwin.orchestrator.record.table_parts import parts_of_table
from foretwin.sim_worker.world_file import load_world

_DECIDE = ("python", "foretwin", "mujoco", "numpy", "scipy", "numba")
"""Versions without which a job may come to other bits."""


class FutureRow(msgspec.Struct, frozen=True):
    """What a row of the table of futures must hold for the future to be played again."""

    future_id: str
    job_sha256: str
    index: int
    planner: str
    trajectory_sha256: str | None
    failure: str | None
    left_out: str | None


class _JobRow(msgspec.Struct, frozen=True):
    job_sha256: str
    job: bytes


class _PlayedWith(msgspec.Struct, frozen=True):
    versions: dict[str, str]
    processor: str
    arithmetic: str = ""
    """"" in tables of before it was told."""


_Row = TypeVar("_Row", FutureRow, _JobRow)


class RecordedFuture(NamedTuple):
    """A future's row, its job, and the World and vehicle that it was played with."""

    row: FutureRow
    job: Job
    world: World
    vehicle: VehicleParameters


def recorded_future(folder: Path, wanted: str) -> RecordedFuture:
    """Return a future of a run or sweep by its id.

    Raises FileNotFoundError, or UserError in one line, where it is not there, is not what was
    written, or was recorded with what is not here: another schema, other versions, another
    processor.
    """
    check_finished(folder)
    file = _file_of(table_at(folder, "futures"), "future_id", wanted)
    row = _row(file, "future_id", wanted, FutureRow)
    jobs = table_at(folder, "jobs")
    part = jobs / file.name if jobs.is_dir() else _file_of(jobs, "job_sha256", row.job_sha256)
    asked = _row(part, "job_sha256", row.job_sha256, _JobRow)
    if hashlib.sha256(asked.job).hexdigest() != row.job_sha256:
        raise UserError(f"{part}: the job of {wanted} is damaged: its hash is another one")
    try:
        job = job_from_bytes(asked.job, where=f"{part}: the job of {wanted}")
        held = wanted == future_id(row.job_sha256, row.index)
        if not held or all(future.index != row.index for future in job.futures):
            raise UserError(f"{file}: index {row.index} is not that of {wanted} in its job")
        world, vehicle = (
            kept_world(folder / "worlds", job.world_id),
            kept_vehicle(folder, job.vehicle),
        )
    except SchemaMismatch as error:
        raise UserError(str(error)) from error
    return RecordedFuture(row, job, world, vehicle)


def recorded_sibling(folder: Path, wanted: str, engine: EngineName) -> str | None:
    """Return the hash of a future's motion on another engine in the drive; None where it was not
    played there."""
    rows = kept_rows(folder / RESULTS, "siblings", "future_id", "engine", "motion_sha256")
    found = (row for row in rows if (row["future_id"], row["engine"]) == (wanted, engine))
    return next((str(row["motion_sha256"]) for row in found), None)


def kept_world(folder: Path, world_id: str) -> World:
    """Return the World of an id; UserError where its file holds what has another one.

    Raises FileNotFoundError or SchemaMismatch as `load_world` does.
    """
    world = load_world(folder, world_id)
    if (found := with_id(world).id) != world_id:
        raise UserError(f"{folder / world_id}.world: was changed: holds World {found}")
    return world


def kept_vehicle(folder: Path, digest: str) -> VehicleParameters:
    """Return the parameters of a digest; UserError where their file holds others.

    Raises FileNotFoundError or SchemaMismatch.
    """
    file = folder / VEHICLES / f"{digest}.vehicle"
    vehicle = read_message(file, VehicleParameters)
    if vehicle_digest(vehicle) != digest:
        raise UserError(f"{file}: was changed: holds vehicle {vehicle_digest(vehicle)}")
    return vehicle


def _file_of(table: Path, column: str, value: str) -> Path:
    """Return which file of a table holds a value; what cannot be read is passed by."""
    files = sorted(table.glob("*.parquet")) if table.is_dir() else parts_of_table(table)
    unread = None if files else UserError(f"{table}: holds no rows")
    for path in files:
        try:
            with opened(path) as file:
                check_result_schema(path, file.schema_arrow)
                # Ids are; Arrow takes no text that is not Unicode.
                if value.isascii() and pc.any(pc.equal(file.read([column])[column], value)).as_py():
                    return path
        except UserError as error:
            unread = unread or error
    raise unread or UserError(f"{table}: no {column} {value!r}")


def _row(path: Path, column: str, value: str, kind: type[_Row]) -> _Row:
    with opened(path) as file:
        _check_same(path, file.schema_arrow)
        for group in range(file.num_row_groups):  # of all others the ids alone are read
            ids = file.read_row_group(group, [column])[column]
            place = pc.index(ids, pa.scalar(value, ids.type)).as_py()
            if place >= 0:
                table = file.read_row_group(group, list(kind.__struct_fields__))
                return msgspec.convert(table.slice(place, 1).to_pylist()[0], kind)
    raise UserError(f"{path}: no {column} {value!r}")


def _check_same(path: Path, schema: pa.Schema) -> None:
    """Raise UserError where a table was written with what may come to other bits."""
    said = check_result_schema(path, schema)
    known = msgspec.json.decode(said.get("versions", "null"))
    then = msgspec.convert({**said, "versions": known}, _PlayedWith)
    now = versions()
    for name in _DECIDE:
        if then.versions.get(name) != now[name]:
            raise UserError(
                f"{path}: recorded with {name} {then.versions.get(name)}, here is {now[name]}: "
                "bits may differ"
            )
    told = bool(then.arithmetic)  # Another processor is as good where numpy's bits are the same.
    ours, theirs = (arithmetic_sha256(), then.arithmetic) if told else (processor(), then.processor)
    if theirs != ours:
        raise UserError(
            f"{path}: recorded on {then.processor}, this is {processor()}: bits may differ"
        )
