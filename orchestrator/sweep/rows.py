"""The rows of a sweep: their columns, their Parquet parts, and the hash of all of them."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import msgspec
import pyarrow as pa
import pyarrow.parquet as pq

from foretwin.orchestrator.sweep.plan import Cell, SweepJob
from foretwin.orchestrator.sweep.spec import SweepSpec

Row = dict[str, Any]

_CELL = (
    ("cell", pa.int64()), ("job", pa.int32()), ("world", pa.string()), ("junction", pa.string()),
    ("place", pa.string()), ("scenario", pa.string()), ("case", pa.int32()),
    ("values", pa.map_(pa.string(), pa.float64())), ("planner", pa.string()),
    ("vehicle", pa.string()), ("seed", pa.int64()),
    ("start_stamp_ns", pa.int64()), ("road_users", pa.string()), ("horizon_s", pa.float64()),
)  # fmt: skip
_PLAYED = (
    ("recorded_road_users", pa.int32()),
    ("valid", pa.bool_()), ("failure", pa.string()), ("left_out", pa.string()),
    ("planned_impact_time_s", pa.float64()), ("planned_impact_with", pa.string()),
    ("planned_impact_off_m", pa.float64()),
    ("collided", pa.bool_()), ("collision_time_s", pa.float64()), ("collision_with", pa.string()),
    ("min_clearance_m", pa.float64()), ("progress_m", pa.float64()),
    ("accident_with", pa.string()), ("accident_kind", pa.string()),
    ("accident_time_s", pa.float64()),
    ("accident_x_m", pa.float64()), ("accident_y_m", pa.float64()),
    ("accident_angle_rad", pa.float64()), ("accident_closing_mps", pa.float64()),
    ("accident_ego_delta_v_mps", pa.float64()), ("accident_user_delta_v_mps", pa.float64()),
    ("trajectory_sha256", pa.string()),
)  # fmt: skip


def schema_of(spec: SweepSpec) -> pa.Schema:
    """Return the columns of a sweep's rows; what a cell did not come to is null in them."""
    parameters = [(f"parameter_{name}", pa.float64()) for name in spec.parameters]
    metrics = [(f"metric_{name}", pa.float64()) for name in spec.metrics]
    return pa.schema([*_CELL, *parameters, *_PLAYED, *metrics])


def blank_row(job: SweepJob, cell: Cell, spec: SweepSpec) -> Row:
    """Return what is known of a cell before it is played."""
    return {
        "cell": cell.number, "job": job.number, "world": job.world_id,
        "junction": cell.junction_id, "place": cell.place, "scenario": cell.scenario_id,
        "case": cell.case, "values": list(cell.values.items()), "planner": job.planner,
        "vehicle": job.vehicle, "seed": spec.seed, "horizon_s": job.horizon_s,
        "road_users": None if spec.recorded is None else spec.recorded.road_users,
        **{f"parameter_{name}": value for name, value in cell.parameters.items()},
        "failure": "", "left_out": "",
    }  # fmt: skip


class Parts:
    """A folder of Parquet files, one for each job that is done; each is whole or not there."""

    def __init__(self, folder: Path, spec: SweepSpec) -> None:
        self.folder = folder
        self._schema = schema_of(spec)
        folder.mkdir(parents=True, exist_ok=True)
        for left in folder.glob("*.writing"):
            left.unlink()

    def path_of(self, job: int) -> Path:
        """Return where the rows of a job are, or would be."""
        return self.folder / f"job-{job:06d}.parquet"

    def write(self, job: int, rows: Sequence[Mapping[str, Any]]) -> None:
        """Write the rows of a job."""
        path = self.path_of(job)
        partial = path.with_suffix(".writing")
        pq.write_table(pa.Table.from_pylist(list(rows), schema=self._schema), partial)
        partial.replace(path)

    def done(self, jobs: Sequence[SweepJob]) -> set[int]:
        """Return the numbers of the jobs whose rows are there, and as many as there should be."""
        found = set()
        for job in jobs:
            path = self.path_of(job.number)
            if not path.exists():
                continue
            try:
                whole = pq.read_metadata(path).num_rows == len(job.cells)
            except (OSError, pa.ArrowException):
                whole = False
            if whole:
                found.add(job.number)
            else:
                path.unlink()
        return found

    def rows(self, jobs: Sequence[SweepJob]) -> Iterator[Row]:
        """Yield all rows in the order of the plan."""
        for job in jobs:
            yield from pq.ParquetFile(self.path_of(job.number)).read().to_pylist()


class RowsHash:
    """SHA-256 over rows in order: what they say, whoever computed them and when."""

    def __init__(self) -> None:
        self._digest = hashlib.sha256()

    def add(self, row: Row) -> None:
        """Take one more row in."""
        self._digest.update(msgspec.msgpack.encode(row))

    def hexdigest(self) -> str:
        """Return the hash of all rows so far."""
        return self._digest.hexdigest()
