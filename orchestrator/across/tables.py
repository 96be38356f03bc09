"""The tables of many runs, each as one: rows of all, with the column `run` before their own.

Arrow reads the files and gives rows to DuckDB, which itself may open none: a question cannot reach
anything but what it is given here.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import pyarrow as pa
import pyarrow.dataset as ds
import pyarrow.fs as pafs

from foretwin.contracts.errors import UserError
from foretwin.orchestrator.across.places import FoundLake, FoundRuns, once
from foretwin.orchestrator.across.run_rows import (
    DAMAGED,
    DRIVE,
    KILLED,
    RunRow,
    drive_row,
    sweep_row,
)
from foretwin.orchestrator.across.table_heads import TableHeads
from foretwin.orchestrator.record.folders_of_runs import table_files
from foretwin.orchestrator.record.run_state import RUNNING
from foretwin.sim_worker.futures.checked_parquet import VERIFIED
from foretwin.sim_worker.futures.columns import columns_of, schema

RUN, RUN_ID, RUNS = "run", "run_id", "runs"
"""The column that says whose a row is, here and in lakes; and the table with a row for each run."""
_ON_DISK = ds.ParquetFragmentScanOptions(pre_buffer=False, **VERIFIED)
"""What is read ahead for object stores costs a fifth more here."""
_PARQUET = ds.ParquetFileFormat(default_fragment_scan_options=_ON_DISK)
_IN_LAKE = ds.ParquetFileFormat(
    default_fragment_scan_options=ds.ParquetFragmentScanOptions(**VERIFIED)
)


class TableSource(NamedTuple):
    """Rows of one table of some runs; in lakes the run is `run_id`, and some may not count."""

    rows: ds.Dataset
    of_lake: bool = False
    without: tuple[str, ...] = ()


class RunTables:
    """What can be asked of runs in folders and lakes; `tell` is given what is left out, and why."""

    def __init__(self, found: FoundRuns, tell: Callable[[str], None]) -> None:
        self._lakes, self._tell = found.lakes, tell
        self._in_folders = list(once(found.rows))
        self._left_out: set[str] = set()
        """Files that turned out to be damaged."""
        for line in found.doubled:
            tell(line)
        for row in self._in_folders:
            if row.state in (RUNNING, KILLED, DAMAGED):
                tell(f"{row.folder}: {row.state}: only its row in runs can be asked")
        whole = [row for row in self._in_folders if row.state not in (RUNNING, KILLED, DAMAGED)]
        # The newest first: its columns come first, and its types count.
        self._files = [(row.run, table_files(Path(row.folder))) for row in reversed(whole)]

    @property
    def names(self) -> list[str]:
        """Return the tables that any run has."""
        there = {name for _, files in self._files for name in files}
        there |= {name for lake in self._lakes for name in lake.manifest.columns}
        return sorted({*there, RUNS})

    def sources(self, name: str) -> list[TableSource]:
        """Return where the rows of a table are; none where no run has it."""
        if name == RUNS:
            return [TableSource(ds.InMemoryDataset(self._runs()))]
        in_folders = self._in_folders_of(name)
        found = [] if in_folders is None else [TableSource(in_folders)]
        seen = {row.run for row in self._in_folders}
        for lake in self._lakes:
            if name in lake.manifest.columns:
                again = tuple(sorted(seen & lake.manifest.runs.keys()))
                found.append(TableSource(_of_lake(lake, name), of_lake=True, without=again))
            seen |= lake.manifest.runs.keys()
        return found

    def leave_out_damaged(self, names: Iterable[str]) -> bool:
        """Look through every row of some tables; returns whether files are left out from now on."""
        before = len(self._left_out)
        for name in names:
            for source in self.sources(name) if name != RUNS else ():
                for part in source.rows.get_fragments():
                    try:
                        part.to_table()
                    except (OSError, pa.ArrowException) as error:
                        if source.of_lake:
                            raise UserError(f"{part.path}: the lake is damaged there") from error
                        self._left_out.add(part.path)
                        self._tell(f"left out: {part.path}: {' '.join(str(error).split())}")
        return len(self._left_out) > before

    def _in_folders_of(self, name: str) -> ds.Dataset | None:
        heads, paths, whose = TableHeads(), [], []
        for run, files in self._files:
            for file in files.get(name, ()):
                if str(file) in self._left_out:
                    continue
                if trouble := heads.trouble(file):
                    self._left_out.add(str(file))
                    self._tell(f"left out: {trouble}")
                else:
                    paths.append(str(file))
                    whose.append(ds.field(RUN) == run)
        if not paths:
            return None
        named = pa.schema([(RUN, pa.string()), *heads.fields.items()])
        # Whose a file is stands in no row, and who asks for some runs opens the files of these.
        return ds.FileSystemDataset.from_paths(
            paths, schema=named, format=_PARQUET, filesystem=pafs.LocalFileSystem(),
            partitions=whose,
        )  # fmt: skip

    def _runs(self) -> pa.Table:
        rows = list(self._in_folders)
        seen = {row.run for row in rows}
        for lake in self._lakes:
            of_lake = [row for row in lake_rows(lake) if row.run not in seen]
            seen |= {row.run for row in of_lake}
            rows += of_lake
        told = [msgspec.structs.asdict(row) for row in rows]
        return pa.Table.from_pylist(told, schema=schema(columns_of(RunRow)))


def _of_lake(lake: FoundLake, name: str) -> ds.Dataset:
    paths = [file for file in sorted(lake.manifest.files) if file.startswith(f"{name}/")]
    factory = ds.FileSystemDatasetFactory(lake.store.system, paths, _IN_LAKE)
    wide = factory.inspect(promote_options="permissive", fragments=None)
    return factory.finish(wide.remove_metadata())


def lake_rows(lake: FoundLake) -> list[RunRow]:
    """Return the rows of the runs that are in a lake."""
    asked: Sequence[str] = (RUN_ID, "kind", "folder", "map_sha256", "record")
    rows = []
    for one in _of_lake(lake, RUNS).to_table(columns=list(asked)).to_pylist():
        record: dict[str, Any] = msgspec.json.decode(one["record"])
        make = drive_row if one["kind"] == DRIVE else sweep_row
        row = make(record, folder=one["folder"], record_text=one["record"])
        run = one[RUN_ID]
        when = row.time or lake.manifest.runs[run].partition.day
        rows.append(msgspec.structs.replace(row, run=run, time=when, map_sha256=one["map_sha256"]))
    return rows
