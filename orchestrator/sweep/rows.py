"""The rows of a sweep: their Parquet parts, and which of them are there."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from foretwin.contracts.errors import UserError
from foretwin.contracts.futures import Job
from foretwin.contracts.job_identity import JobBytes, job_bytes
from foretwin.orchestrator.record.recorded_jobs import opened
from foretwin.orchestrator.record.run_folder import METRICS_FILE, SWEPT_TABLES
from foretwin.orchestrator.sweep.plan import SweepJob
from foretwin.sim_worker.futures.future_rows import Row
from foretwin.sim_worker.futures.job_tables import (
    JOB_TABLES,
    as_table,
    job_row,
    metric_rows,
    played_with,
    road_user_rows,
)


class Parts:
    """The tables of a sweep in its folder: Parquet files for each job that is done, each of which
    is whole or not there."""

    def __init__(self, folder: Path, *, attribution: str) -> None:
        self._folder = folder
        self._metadata = {"attribution": attribution, **played_with()}
        for name in SWEPT_TABLES.values():
            (folder / name).mkdir(parents=True, exist_ok=True)
            for left in (folder / name).glob("*.writing"):
                left.unlink()
        self._write("metrics", folder / METRICS_FILE, metric_rows())

    def write(self, rows: list[Row], job: Job, recorded: JobBytes) -> None:
        """Write a job, the road users in it, and the rows of its futures."""
        tables = _given(job, recorded) | {"futures": rows}
        for table in SWEPT_TABLES:
            self._write(table, self._part(table, job.job_index), tables[table])

    def _part(self, table: str, job: int) -> Path:
        return self._folder / SWEPT_TABLES[table] / f"job-{job:06d}.parquet"

    def _write(self, table: str, path: Path, rows: list[Row]) -> None:
        partial = path.with_suffix(".writing")
        pq.write_table(as_table(table, rows, self._metadata), partial, compression="zstd")
        partial.replace(path)

    def keep_first(self, count: int) -> None:
        """Remove parts of jobs that are not among the first so many: of another plan."""
        for name in SWEPT_TABLES.values():
            for path in sorted((self._folder / name).glob("job-*.parquet"))[::-1]:
                if int(path.stem.removeprefix("job-")) < count:
                    break
                path.unlink()

    def hold(self, job: Job) -> bool:
        """Return whether a job is done: all its parts are there, readable and its own, and none of
        its futures was given up with the job."""
        try:
            there = {table: self._read(table, job.job_index) for table in SWEPT_TABLES}
        except (UserError, FileNotFoundError):
            return False
        recorded = job_bytes(job)
        given = {name: len(rows) for name, rows in _given(job, recorded).items()}
        for table, count in (given | {"futures": len(job.futures)}).items():
            if there[table]["job_sha256"].to_pylist() != count * [recorded.sha256]:
                return False
        rows = there["futures"].select(["valid", "left_out"]).to_pylist()
        return all(row["valid"] is not None or row["left_out"] for row in rows)

    def _read(self, table: str, job: int) -> pa.Table:
        """Return a part; UserError where it is damaged, FileNotFoundError where it is lost."""
        with opened(self._part(table, job)) as file:
            part = file.read()
            part.validate(full=True)
            if part.schema != JOB_TABLES[table]:
                raise UserError(f"{self._part(table, job)}: has other columns")
        return part

    def rows(self, jobs: Sequence[SweepJob]) -> Iterator[Row]:
        """Yield all rows in the order of the plan."""
        for job in jobs:
            yield from self._read("futures", job.number).to_pylist()


def _given(job: Job, recorded: JobBytes) -> dict[str, list[Row]]:
    """Return the rows that are known before a job is played, by table."""
    users = road_user_rows(job, recorded.sha256)
    return {"road_users": users, "jobs": [job_row(job, recorded)]}
