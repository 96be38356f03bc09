"""What a sweep left, as far as a report tells it."""

from __future__ import annotations

import contextlib
import json
from functools import cached_property
from operator import itemgetter
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from foretwin.contracts.arrays import Array
from foretwin.contracts.errors import UserError, one_line
from foretwin.contracts.world import World
from foretwin.orchestrator.record.run_folder import SUMMARY, table_at
from foretwin.orchestrator.report.material import (
    FUTURE_COLUMNS,
    KeptWorlds,
    TableRow,
    most_critical,
)
from foretwin.orchestrator.sweep.folder import WORLDS
from foretwin.orchestrator.sweep.manifest import listed_parts
from foretwin.orchestrator.sweep.spec import SweepSpec
from foretwin.orchestrator.sweep.summary import played_of, summed
from foretwin.sim_worker.futures.checked_parquet import read_parquet
from foretwin.sim_worker.futures.job_tables import JOB_TABLES
from foretwin.sim_worker.metrics.table import ROW_METRICS

_COLUMNS = (
    *(name for name in FUTURE_COLUMNS if name != "round_id"),
    "place",
    "case",
    "accident_ego_delta_v_mps",
)


class SweepMaterial:
    """A sweep's folder: its summary, its rows and Worlds."""

    def __init__(self, folder: Path, *, called: str = "") -> None:
        self.folder, self.called = folder, called or str(folder)
        try:
            self.record: dict[str, Any] = json.loads((folder / SUMMARY).read_bytes())
        except (OSError, ValueError) as error:
            raise UserError(f"{folder}: no {SUMMARY} to be read: {error}") from error
        if "scenarios" not in self.record:
            self.record |= _until_now(folder, self.record)
        for one in self.record.get("scenarios") or ():
            one["played"] = played_of(one)
            one.setdefault("not_placed_rows", sum(one["not_placed"].values()))
        self._worlds = KeptWorlds(folder)

    @cached_property
    def futures(self) -> pa.Table:
        """Return all rows with the columns that a report reads, none where none was written;
        UserError where their file is damaged."""
        columns = [*_COLUMNS, *(f"metric_{name}" for name in ROW_METRICS)]
        file: Path | None = None
        with contextlib.suppress(FileNotFoundError):
            file = table_at(self.folder, "futures")
        if file is None or (file.is_dir() and not any(file.glob("*.parquet"))):
            return JOB_TABLES["futures"].empty_table().select(columns)
        try:
            return read_parquet(file, columns)
        except (OSError, pa.ArrowException) as error:
            raise UserError(f"{file}: cannot be read: {one_line(error)}") from error

    @cached_property
    def played(self) -> pa.Table:
        """Return the rows that were played to their end."""
        return self.futures.filter(pc.field("valid"))

    def worst(self, most: int) -> tuple[TableRow, ...]:
        """Return the most critical cases, one of each scenario, planner and junction."""
        return most_critical(self.played, most, of=itemgetter("scenario", "planner", "junction_id"))

    def metric_means(self) -> dict[str, tuple[str, str]]:
        """Return unit and better direction of the metrics that the sweep measured."""
        try:
            told = read_parquet(table_at(self.folder, "metrics")).to_pylist()
        except (OSError, pa.ArrowException):
            return {}
        measured = {
            name
            for name in self.played.column_names
            if name.startswith("metric_") and self.played[name].null_count < self.played.num_rows
        }
        return {
            one["name"]: (one["unit"], one["better"])
            for one in told
            if f"metric_{one['name']}" in measured
        }

    def values_of(self, column: str) -> dict[str, Array]:
        """Return the known values of a column by planner."""
        found = {}
        for planner in pc.unique(self.played["planner"]).to_pylist():
            mine = self.played.filter(pc.field("planner") == planner)[column].drop_null()
            found[planner] = np.asarray(mine.to_numpy(), dtype=np.float64)
        return found

    def world(self, world_id: str) -> World | None:
        """Return a World of the sweep, None where it cannot be read."""
        return self._worlds.get(world_id)

    def worlds(self) -> list[World]:
        """Return the Worlds of the sweep that can be read."""
        return self._worlds.those_of(pc.unique(self.futures["world_id"]).to_pylist())

    @property
    def map(self) -> dict[str, str]:
        """Return the map's file and hash, named as in a drive's record; none of given Worlds."""
        file = (self.record.get("spec") or {}).get("map")
        hashes = dict.fromkeys(world.map_sha256 for world in self.worlds()) if file else ()
        return {"file": str(file), "sha256": ", ".join(hashes)} if hashes else {}

    def junction_name(self, junction_id: str | None) -> str:
        """Return what a driver calls a junction of the sweep; its id where that is not known."""
        return self._names.get(junction_id or "", "") or junction_id or "no junction"

    @cached_property
    def _names(self) -> dict[str, str]:
        return {one.intersection.id: one.intersection.name for one in self.worlds()}


def _until_now(folder: Path, record: dict[str, Any]) -> dict[str, Any]:
    """Return what the jobs come to that are there of a sweep that has not come to its end."""
    try:
        spec = msgspec.convert(record.get("spec"), SweepSpec)
        parts = listed_parts(folder)
    except (OSError, msgspec.ValidationError):
        return {}
    counted = summed(spec, parts)
    del counted["rows_sha256"]  # is of a whole sweep
    return {**counted, "worlds": len(list((folder / WORLDS).glob("*.world")))}
