"""The rows of a sweep: the Parquet parts that who played them finished, and which are there."""

from __future__ import annotations

import hashlib
import os
import re
import shutil
from collections.abc import Iterator, Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple, Self

import pyarrow as pa
import pyarrow.parquet as pq

from foretwin.contracts.partial_file import partial_file
from foretwin.contracts.parts import FinishedPart, JobCells
from foretwin.orchestrator.record.durable import WRITING
from foretwin.orchestrator.record.run_folder import METRICS_FILE, SWEPT_TABLES
from foretwin.orchestrator.sweep.manifest import Manifest, PartEntry
from foretwin.sim_worker.futures.finished_part import parquet_bytes
from foretwin.sim_worker.futures.job_tables import JOB_TABLES, as_table, metric_rows, played_with

_HASH = re.compile("[0-9a-f]{64}")
_PART = re.compile(r"job-(\d+)\.parquet")


class Parts:
    """The tables of a sweep in its folder: Parquet files of each job that is done, whole or not
    there, and listed once they are. No row is read here. Use it as a context."""

    def __init__(self, folder: Path, *, jobs: int, attribution: str) -> None:
        self._folder, self._jobs, self._attribution = folder, jobs, attribution
        self._held = ExitStack()

    def __enter__(self) -> Self:
        for name in SWEPT_TABLES.values():
            (self._folder / name).mkdir(parents=True, exist_ok=True)
        self._remove_strangers()
        metadata = {"attribution": self._attribution, **played_with()}
        metrics = as_table("metrics", metric_rows(), metadata)
        _write(self._folder / METRICS_FILE, parquet_bytes(metrics))
        with ExitStack() as held:
            self._manifest = held.enter_context(Manifest(self._folder, jobs=self._jobs))
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

    def adopt(self, entry: PartEntry, files: Mapping[str, Path]) -> None:
        """Keep the part of a job from files of another folder; raises OSError as `write` does."""
        for table, file in files.items():
            link_whole(file, self._part(table, entry.job))
        self._manifest.add(entry)

    def _part(self, table: str, job: int) -> Path:
        return part_file(self._folder, table, job)

    def _remove_strangers(self) -> None:
        """Remove what was never whole, and parts of jobs of another, longer plan."""
        for name in SWEPT_TABLES.values():
            for entry in os.scandir(self._folder / name):
                number = _PART.fullmatch(entry.name)
                if entry.name.endswith(WRITING) or (number and int(number[1]) >= self._jobs):
                    Path(entry.path).unlink()

    def lists(self, number: int) -> bool:
        """Return whether a job may be done."""
        return self._manifest.lists(number)

    def hold(self, number: int, job_sha256: str) -> bool:
        """Return whether a job is done: all its files are there as they were written, and none of
        its futures was given up with the job."""
        entry = self._manifest.entry(number)
        if entry is None or entry.job_sha256 != job_sha256 or entry.given_up:
            return False
        try:
            found = {name: sha256_of(self._part(name, number)) for name in SWEPT_TABLES}
        except OSError:
            return False
        return found == entry.tables

    def entries(self) -> Iterator[PartEntry]:
        """Yield what is listed, in the order of the plan."""
        return self._manifest.entries()


def part_file(folder: Path, table: str, job: int) -> Path:
    """Return where a sweep's folder has the part of a job."""
    return folder / SWEPT_TABLES[table] / f"job-{job:06d}.parquet"


def sha256_of(file: Path) -> str:
    """Return the hash of a file; raises OSError."""
    return _sha256(file.read_bytes())


def link_whole(file: Path, to: Path) -> None:
    """Let a file be at another place too: the same one, or where that is on another disk a copy,
    whole or not there. Raises OSError."""
    if to.exists() and to.samefile(file):
        return  # and POSIX would leave both names of one file where one is to replace the other
    with partial_file(to, ending=WRITING) as partial:
        partial.unlink(missing_ok=True)
        try:
            os.link(file, partial)
        except OSError:
            shutil.copyfile(file, partial)


class Due(NamedTuple):
    """What a finished part is expected of: a job by its number and hash, who drives in it, and how
    many others are around as its futures begin."""

    number: int
    job_sha256: str
    planner: str
    road_users: int
    cells: JobCells


def fault_in(part: FinishedPart | None, due: Due) -> str:
    """Return why something is not the finished part that is due, "" where it is.

    Of its files what stands at their ends is read: columns, how many rows, of which job and cells.
    """
    if part is None or part.job_sha256 != due.job_sha256:
        return "no part of this job"
    count, first = len(due.cells.cases), due.cells.first
    rows = {"futures": count, "jobs": 1, "road_users": due.road_users}
    if part.tables.keys() != rows.keys():
        return f"holds tables {', '.join(sorted(part.tables)) or 'none'}"
    try:
        ends = {name: _end_of(data) for name, data in part.tables.items()}
    except (pa.ArrowException, OSError) as error:
        return f"no Parquet: {' '.join(str(error).split())}"
    for name, (schema, end) in ends.items():
        if not schema.equals(JOB_TABLES[name]):
            return f"{name} have other columns"
        if end.num_rows != rows[name]:
            return f"{end.num_rows} rows of {name}; {rows[name]} are due"
    spans = {"job_sha256": 2 * (due.job_sha256,), "cell": (first, first + count - 1)}
    for column, span in spans.items():
        if _span(ends["futures"][1], column) != span:
            return f"futures of another {column}"
    who = {(scenario, due.planner) for scenario in due.cells.scenarios}
    counted = {(one.scenario, one.planner): one.cases for one in part.counts}
    if counted.keys() != who or sum(counted.values()) != count:
        return "counts other rows than it holds"
    if _HASH.fullmatch(part.rows_sha256) is None:
        return "no hash of its rows"
    return ""


def _end_of(data: bytes) -> tuple[pa.Schema, pq.FileMetaData]:
    """Return what stands at the end of a file; raises ArrowException or OSError.

    The schema is Arrow's: metadata and the Parquet schema that they give hold one another.
    """
    with pq.ParquetFile(pa.BufferReader(data)) as file:
        return file.schema_arrow, file.metadata


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
