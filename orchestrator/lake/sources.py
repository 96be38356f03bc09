"""Runs and sweeps as they are collected: what they are, where they belong, and their rows."""

from __future__ import annotations

import datetime
import functools
import hashlib
import json
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import pyarrow as pa

from foretwin.contracts.codec import SchemaMismatch
from foretwin.contracts.errors import UserError
from foretwin.orchestrator.lake.manifest import NONE, Partition
from foretwin.orchestrator.record.folders_of_runs import table_files
from foretwin.orchestrator.record.result_files import check_result_schema, opened
from foretwin.orchestrator.record.results import TABLES
from foretwin.orchestrator.record.run_folder import METRICS_FILE, SUMMARY
from foretwin.orchestrator.record.run_state import RECORD, check_finished
from foretwin.orchestrator.sweep.folder import WORLDS
from foretwin.sim_worker.futures.columns import columns, schema
from foretwin.sim_worker.world_file import load_world

RUN_ID = "run_id"
"""The column that every table of a lake has besides its own."""
RUNS = "runs"
"""The table with one row for each run."""
RUNS_SCHEMA = schema(
    columns(
        "kind:str folder:str source_sha256:str exit:str foretwin:str seed:int map_file:str "
        "map_sha256:str attribution:str drive_time_s:float wall_s:float recordings_bytes:int "
        "record:str"
    )
)
BATCH_ROWS = 8192
_DAY = re.compile(r"(\d{4})(\d\d)(\d\d)-")
_MAP_DIGITS = 12


class RunSource(NamedTuple):
    """A run or sweep that came to its end; its tables are not looked into yet.

    `sha256` is that of all that is collected: of a drive the bytes of its record and tables, of a
    sweep what decides its rows and the rows themselves, however they were played and written.
    """

    folder: Path
    run_id: str
    kind: str
    record: dict[str, Any]
    files: dict[str, tuple[Path, ...]]
    """Of each table."""
    sha256: str


def source_of(folder: Path) -> RunSource:
    """Return what a folder holds; UserError where that is no run or sweep that has come to its
    end."""
    if (folder / SUMMARY).is_file():
        return _sweep(folder)
    check_finished(folder)
    record = _json(folder / RECORD)
    there = table_files(folder)
    files = {name: there[name] for name in TABLES if name in there}
    if not files:
        raise UserError(f"{folder}: holds no tables of results")
    digest = hashlib.sha256()
    for path in (folder / RECORD, *(path for paths in files.values() for path in paths)):
        with path.open("rb") as file:
            digest.update(f"{path.name} ".encode())
            digest.update(hashlib.file_digest(file, "sha256").digest())
    run_id = str(record.get("run_id", folder.resolve().name))
    return RunSource(folder, run_id, "drive", record, files, digest.hexdigest())


def _sweep(folder: Path) -> RunSource:
    record = _json(folder / SUMMARY)
    if shard := record.get("shard"):
        raise UserError(f"{folder}: shard {shard} of a sweep: `foretwin sweep --merge` them first")
    if not record.get("complete"):
        raise UserError(f"{folder}: the sweep has not come to its end: `foretwin sweep` goes on")
    files = table_files(folder)
    files["metrics"] = (folder / METRICS_FILE,)
    fingerprint = str(record["fingerprint"])
    # Its record also says how long this process played, and its parts may be cut in other ways.
    digest = hashlib.sha256(f"{fingerprint} {record['rows_sha256']}".encode()).hexdigest()
    return RunSource(folder, f"sweep-{fingerprint[:16]}", "sweep", record, files, digest)


def _json(path: Path) -> dict[str, Any]:
    try:
        record = json.loads(path.read_bytes())
    except FileNotFoundError:
        raise UserError(f"{path.parent}: holds no {path.name}: neither a run nor a sweep") from None
    except (OSError, ValueError) as error:
        raise UserError(f"{path}: cannot be read: {' '.join(str(error).split())}") from error
    if not isinstance(record, dict):
        raise UserError(f"{path}: is no record of a run")
    return record


class SourceTables:
    """The tables of one source, each with the column `run_id`, and `runs` with its one row.

    Raises UserError for tables of another foretwin, and for damage wherever it is met.
    """

    def __init__(self, source: RunSource) -> None:
        self.source = source
        self.schemas: dict[str, pa.Schema] = {RUNS: _with_run_id(RUNS_SCHEMA)}
        self.rows = {RUNS: 1}
        self.attribution = ""
        """Whose data the map is."""
        self.size_bytes = 0
        self._files: dict[str, list[Path]] = {}
        for name, paths in source.files.items():
            for path in paths:
                with opened(path) as file:
                    told = check_result_schema(path, file.schema_arrow)
                    self.attribution = told.get("attribution", self.attribution)
                    if rows := file.metadata.num_rows:
                        self.rows[name] = self.rows.get(name, 0) + rows
                        self._files.setdefault(name, []).append(path)
                        self.schemas[name] = _with_run_id(file.schema_arrow.remove_metadata())
                        self.size_bytes += path.stat().st_size
        self._map_sha256 = _sha256_of_map(source)
        self.partition = self._partition()
        """Where the run belongs."""

    def _partition(self) -> Partition:
        record, sha256 = self.source.record, self._map_sha256
        return Partition(
            day=_day(self.source),
            vehicle=str((record.get("config") or {}).get("vehicle_id") or NONE),
            # So that a hash of digits alone is no number to whoever guesses types.
            map=f"osm-{sha256[:_MAP_DIGITS]}" if sha256 else NONE,
        )

    def batches(self, table: str) -> Iterator[pa.RecordBatch]:
        """Yield the rows of a table in their order."""
        if table == RUNS:
            rows = pa.RecordBatch.from_pylist([self._run_row()], schema=self.schemas[RUNS])
            yield rows
            return
        for path in self._files[table]:
            with opened(path) as file:
                for batch in file.iter_batches(BATCH_ROWS):
                    run_ids = pa.repeat(pa.scalar(self.source.run_id), batch.num_rows)
                    yield pa.RecordBatch.from_arrays(
                        [run_ids, *batch.columns],
                        schema=_with_run_id(batch.schema.remove_metadata()),
                    )

    def _run_row(self) -> dict[str, Any]:
        source, record = self.source, self.source.record
        told_map, spec = record.get("map") or {}, record.get("spec") or {}
        recordings = [path for path in source.folder.glob("*") if path.suffix in (".mcap", ".rrd")]
        known = {name: record.get(name) for name in ("exit", "drive_time_s", "wall_s")}
        return {
            RUN_ID: source.run_id,
            "kind": source.kind,
            "folder": str(source.folder.resolve()),
            "source_sha256": source.sha256,
            "foretwin": (record.get("versions") or {}).get("foretwin"),
            "seed": record.get("seed", spec.get("seed")),
            "map_file": told_map.get("file", spec.get("map")),
            "map_sha256": self._map_sha256 or None,
            "attribution": self.attribution,
            "recordings_bytes": sum(path.stat().st_size for path in recordings),
            "record": json.dumps(record, ensure_ascii=False, separators=(",", ":")),
            **known,
        }


def _sha256_of_map(source: RunSource) -> str:
    if source.kind == "drive":
        return str((source.record.get("map") or {}).get("sha256") or "")
    return map_of_sweep(source.folder, source.record)


def map_of_sweep(folder: Path, record: Mapping[str, Any]) -> str:
    """Return the SHA-256 of a sweep's map; empty for given Worlds, which may be of several."""
    if not (record.get("spec") or {}).get("map"):
        return ""
    worlds = folder / WORLDS
    try:
        world_id = next(iter(sorted(worlds.glob("*.world")))).stem
        return load_world(worlds, world_id).map_sha256
    except (StopIteration, OSError, SchemaMismatch):
        return ""


def _day(source: RunSource) -> str:
    """Return the day that a drive's id says, else that on which its record was written."""
    if named := _DAY.match(source.run_id):
        return "-".join(named.groups())
    record = source.folder / (RECORD if source.kind == "drive" else SUMMARY)
    return datetime.datetime.fromtimestamp(record.stat().st_mtime).date().isoformat()


@functools.cache
def _with_run_id(found: pa.Schema) -> pa.Schema:
    """Return the columns of a lake's table; of a thousand runs they are the same few objects."""
    return pa.schema([pa.field(RUN_ID, pa.string()), *found])
