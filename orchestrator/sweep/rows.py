"""The rows of a sweep: the Parquet parts that who played them finished, and which are there."""

from __future__ import annotations

import functools
import hashlib
import re
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Self

import pyarrow as pa
import pyarrow.parquet as pq

from foretwin.contracts.futures import Job
from foretwin.contracts.partial_file import partial_file
from foretwin.contracts.parts import FinishedPart, JobCells
from foretwin.orchestrator.record.durable import WRITING
from foretwin.orchestrator.record.run_folder import METRICS_FILE, SWEPT_TABLES
from foretwin.orchestrator.sweep.manifest import Manifest, PartEntry
from foretwin.sim_worker.futures.finished_part import parquet_bytes
from foretwin.sim_worker.futures.job_tables import JOB_TABLES, as_table, metric_rows, played_with

_HASH = re.compile("[0-9a-f]{64}")


class Parts:
    """The tables of a sweep in its folder: Parquet files of each job that is done, whole or not
    there, and listed once they are. No row is read here. Use it as a context."""

    def __init__(self, folder: Path, *, attribution: str) -> None:
        self._folder, self._attribution = folder, attribution
        self._held = ExitStack()

    def __enter__(self) -> Self:
        for name in SWEPT_TABLES.values():
            (self._folder / name).mkdir(parents=True, exist_ok=True)
            for left in (self._folder / name).glob(f"*{WRITING}"):
                left.unlink()
        metadata = {"attribution": self._attribution, **played_with()}
        metrics = as_table("metrics", metric_rows(), metadata)
        _write(self._folder / METRICS_FILE, parquet_bytes(metrics))
        with ExitStack() as held:
            self._manifest = held.enter_context(Manifest(self._folder))
            self._held = held.pop_all()
        return self

    def __exit__(self, *what: object) -> None:
        self._held.close()

    def write(self, number: int, part: FinishedPart) -> None:
        """Keep the part of the job of a number; raises OSError, and then it is not listed."""
        for table, data in part.tables.items():
            _write(self._part(table, number), data)
        self._manifest.add(
            PartEntry(
                job=number,
                job_sha256=part.job_sha256,
                rows=sum(count.cases for count in part.counts),
                rows_sha256=part.rows_sha256,
                tables={table: _sha256(data) for table, data in part.tables.items()},
                counts=part.counts,
                given_up=part.given_up,
            )
        )

    def _part(self, table: str, job: int) -> Path:
        return self._folder / SWEPT_TABLES[table] / f"job-{job:06d}.parquet"

    def keep_first(self, count: int) -> None:
        """Remove parts of jobs that are not among the first so many: of another plan."""
        for name in SWEPT_TABLES.values():
            for path in (self._folder / name).glob("job-*.parquet"):
                if int(path.stem.removeprefix("job-")) >= count:
                    path.unlink()

    @property
    def listed(self) -> int:
        """Return one more than the greatest number of a job that may be there."""
        return len(self._manifest)

    def hold(self, number: int, job_sha256: str) -> bool:
        """Return whether a job is done: all its files are there as they were written, and none of
        its futures was given up with the job."""
        entry = self._manifest.entry(number)
        if entry is None or entry.job_sha256 != job_sha256 or entry.given_up:
            return False
        try:
            found = {name: _sha256(self._part(name, number).read_bytes()) for name in SWEPT_TABLES}
        except OSError:
            return False
        return found == entry.tables

    def entries(self, jobs: int) -> Iterator[PartEntry]:
        """Yield what is listed of the first so many jobs, in the order of the plan."""
        return self._manifest.entries(jobs)


def fault_in(part: FinishedPart | None, job: Job, job_sha256: str, cells: JobCells) -> str:
    """Return why something is not the finished part of a job, "" where it is one.

    Of its files what stands at their ends is read: columns, how many rows, of which job and cells.
    """
    if part is None or part.job_sha256 != job_sha256:
        return "no part of this job"
    count = len(job.futures)
    rows = {"futures": count, "jobs": 1, "road_users": len(job.replayed) + len(job.road_users)}
    if part.tables.keys() != rows.keys():
        return f"holds tables {', '.join(sorted(part.tables)) or 'none'}"
    try:
        ends = {name: pq.read_metadata(pa.BufferReader(part.tables[name])) for name in rows}
    except (pa.ArrowException, OSError) as error:
        return f"no Parquet: {' '.join(str(error).split())}"
    for name, end in ends.items():
        if not end.schema.equals(_parquet_schema(name)):
            return f"{name} have other columns"
        if end.num_rows != rows[name]:
            return f"{end.num_rows} rows of {name}; {rows[name]} are due"
    spans = {"job_sha256": (job_sha256, job_sha256), "cell": (cells.first, cells.first + count - 1)}
    for column, span in spans.items():
        if _span(ends["futures"], column) != span:
            return f"futures of another {column}"
    who = {(scenario, job.futures[0].planner) for scenario in cells.scenarios}
    counted = {(one.scenario, one.planner): one.cases for one in part.counts}
    if counted.keys() != who or sum(counted.values()) != count:
        return "counts other rows than it holds"
    if _HASH.fullmatch(part.rows_sha256) is None:
        return "no hash of its rows"
    return ""


@functools.cache
def _parquet_schema(table: str) -> pq.ParquetSchema:
    empty = parquet_bytes(JOB_TABLES[table].empty_table())
    return pq.read_metadata(pa.BufferReader(empty)).schema


def _span(end: pq.FileMetaData, column: str) -> tuple[object, object]:
    """Return the least and the greatest value of a column, as the end of its file tells."""
    place = JOB_TABLES["futures"].names.index(column)
    told = [end.row_group(n).column(place).statistics for n in range(end.num_row_groups)]
    if not all(one is not None and one.has_min_max for one in told):
        return None, None
    return min(one.min for one in told), max(one.max for one in told)


def _write(path: Path, data: bytes) -> None:
    with partial_file(path, ending=WRITING) as partial:
        partial.write_bytes(data)


def _sha256(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()
