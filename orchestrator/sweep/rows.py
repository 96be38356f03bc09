"""The rows of a sweep: their columns, their Parquet parts, and the hash of all of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from foretwin.contracts.futures import Job
from foretwin.contracts.job_identity import JobBytes
from foretwin.orchestrator.record.job_tables import (
    METRICS_FILE,
    SWEPT_TABLES,
    as_table,
    job_row,
    metric_rows,
    played_with,
    road_user_rows,
)
from foretwin.orchestrator.sweep.plan import SweepJob
from foretwin.sim_worker.futures.future_rows import Row


class Parts:
    """The tables of a sweep in its folder: Parquet files for each job that is done, each of which
    is whole or not there."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._metadata = folder, played_with()
        for name in SWEPT_TABLES.values():
            (folder / name).mkdir(parents=True, exist_ok=True)
            for left in (folder / name).glob("*.writing"):
                left.unlink()
        self._write("metrics", folder / METRICS_FILE, metric_rows())

    def path_of(self, job: int) -> Path:
        """Return where the rows of a job's futures are, or would be."""
        return self._part("futures", job)

    def write(self, rows: list[Row], job: Job, recorded: JobBytes) -> None:
        """Write a job, the road users in it, and the rows of its futures."""
        users = road_user_rows(job, recorded.sha256)
        tables = {"road_users": users, "jobs": [job_row(job, recorded)], "futures": rows}
        for table in SWEPT_TABLES:
            self._write(table, self._part(table, job.job_index), tables[table])

    def _part(self, table: str, job: int) -> Path:
        return self._folder / SWEPT_TABLES[table] / f"job-{job:06d}.parquet"

    def _write(self, table: str, path: Path, rows: list[Row]) -> None:
        partial = path.with_suffix(".writing")
        pq.write_table(as_table(table, rows, self._metadata), partial, compression="zstd")
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
