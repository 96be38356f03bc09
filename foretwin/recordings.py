"""What a run or a sweep left, as tables and arrays: the part of the face that looks back."""

from __future__ import annotations

import json
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from foretwin.checks import expect, path_of
from foretwin.contracts.arrays import Array
from foretwin.contracts.codec import SchemaMismatch
from foretwin.contracts.errors import UserError
from foretwin.contracts.segments import DRIVE_FILE, first_left
from foretwin.contracts.world import World
from foretwin.orchestrator.record.folders_of_runs import table_files
from foretwin.orchestrator.record.run_folder import SUMMARY, table_at
from foretwin.orchestrator.record.run_state import RECORD, check_finished
from foretwin.orchestrator.record.table_parts import read_parts
from foretwin.sim_worker.futures.checked_parquet import read_parquet
from foretwin.simulation import Futures


class MotionArrays(NamedTuple):
    """Where a car drove, as estimated from what it sent: (N,) each, of base_link.

    `time_s` counts from the first state; yaw counter-clockwise from east.
    """

    stamp_ns: NDArray[np.int64]
    time_s: Array
    lat_deg: Array
    lon_deg: Array
    yaw_rad: Array
    speed_mps: Array


class Recording:
    """A run's or a sweep's folder: its record, its tables by name, Worlds and trajectories."""

    def __init__(self, folder: Path, record_file: str) -> None:
        self.folder = folder
        try:
            text = (folder / record_file).read_text(encoding="utf-8")
            self.record: dict[str, Any] = json.loads(text)
        except (OSError, ValueError) as error:
            raise UserError(f"{folder}: no {record_file} to be read: {error}") from error

    @property
    def tables(self) -> tuple[str, ...]:
        """Return the names of its tables."""
        return tuple(sorted(table_files(self.folder)))

    def table(self, name: str) -> pa.Table:
        """Return a table, such as `futures`, `jobs`, `metrics`, or a run's `comparisons`.

        Raises UserError where there is none.
        """
        try:
            table = table_at(self.folder, name)
        except FileNotFoundError as error:
            raise UserError(str(error)) from error
        try:
            return read_parquet(table) if table.is_dir() else read_parts(table)
        except (OSError, pa.ArrowException) as error:
            raise UserError(f"{self.folder}: no table {name!r} to be read: {error}") from error

    def pandas(self, name: str) -> Any:
        """Return a table as a DataFrame of pandas; UserError where it is not installed."""
        _library("pandas")
        return self.table(name).to_pandas()

    def polars(self, name: str) -> Any:
        """Return a table as a DataFrame of Polars; UserError where it is not installed."""
        return _library("polars").from_arrow(self.table(name))

    @property
    def world_ids(self) -> tuple[str, ...]:
        """Return the ids of the Worlds that it was simulated in, as the column `world_id` has."""
        return tuple(sorted(path.stem for path in (self.folder / "worlds").glob("*.world")))

    def world(self, world_id: str) -> World:
        """Return a World by its id; UserError where it is not there or was changed."""
        from foretwin.orchestrator.record.recorded_jobs import kept_world

        try:
            return kept_world(self.folder / "worlds", world_id)
        except (FileNotFoundError, SchemaMismatch) as error:
            known = ", ".join(self.world_ids) or "none"
            raise UserError(f"{self.folder}: no World {world_id!r} to be read: {known}") from error

    def futures_of(self, future_id: str) -> Futures:
        """Play the job of a future again, to the same bits; returns all of its futures that were
        played, `rows` in the order of `states`.

        Tables hold what came of futures, not their motion. `states` has (S, N, 8) of base_link in
        the frame of `world(world_id)`. Raises UserError where it cannot be repeated as
        `foretwin repeat` does, or comes to something else.
        """
        from foretwin.orchestrator.record.played_again import play_again
        from foretwin.orchestrator.record.recorded_jobs import recorded_future
        from foretwin.sim_worker.futures.future_rows import future_rows

        try:
            recorded = recorded_future(self.folder, expect("future_id", future_id, str))
        except FileNotFoundError as error:
            raise UserError(str(error)) from error
        result, sha256 = play_again(recorded)
        if sha256.get(recorded.row.index) != recorded.row.trajectory_sha256:
            raise UserError(f"{self.folder}: {future_id} comes to something else now")
        rows = future_rows(recorded.job, result, job_sha256=recorded.row.job_sha256)
        by_index = {row["index"]: row for row in rows}
        return Futures(recorded.job, result, [by_index[index] for index in result.future_indices])

    def driven(self) -> MotionArrays:
        """Return where the car of a run drove, estimated from its recording as it was then.

        Raises UserError where there is none, as in a sweep.
        """
        from foretwin.orchestrator.commands.compare import estimated_states

        file = first_left(self.folder / DRIVE_FILE)
        if not file.is_file():
            raise UserError(f"{self.folder}: holds no {DRIVE_FILE}: no car drove in it")
        states, _ = estimated_states(file, None)
        stamps = np.array([state.stamp_ns for state in states], np.int64)
        return MotionArrays(
            stamp_ns=stamps,
            time_s=(stamps - stamps[0]) * 1e-9,
            lat_deg=np.array([state.position.lat_deg for state in states]),
            lon_deg=np.array([state.position.lon_deg for state in states]),
            yaw_rad=np.array([state.yaw_rad for state in states]),
            speed_mps=np.array([state.speed_mps for state in states]),
        )


def _library(name: str) -> Any:
    """Return a library that foretwin does without; UserError where it is not installed."""
    try:
        return import_module(name)
    except ModuleNotFoundError as error:
        raise UserError(f"{name} is not installed: pip install {name}") from error


def open_run(folder: Path | str) -> Recording:
    """Open what `foretwin drive` left; UserError where the folder holds no run, or one that has
    not come to its end."""
    recording = Recording(path_of("folder", folder), RECORD)
    check_finished(recording.folder)
    return recording


def open_sweep(folder: Path | str) -> Recording:
    """Open what `foretwin sweep` left; UserError where the folder holds no sweep."""
    return Recording(path_of("folder", folder), SUMMARY)
