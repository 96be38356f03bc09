"""What a run or a sweep left, as tables: the part of the face that looks back."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from foretwin.checks import path_of
from foretwin.contracts.errors import UserError
from foretwin.orchestrator.record.run_folder import table_at
from foretwin.orchestrator.record.run_state import check_finished
from foretwin.orchestrator.record.table_parts import read_parts

_RUN, _SWEEP = "run.json", "sweep.json"


class Recording:
    """A run's or a sweep's folder: its record, and its tables by name."""

    def __init__(self, folder: Path, record_file: str) -> None:
        self.folder = folder
        try:
            text = (folder / record_file).read_text(encoding="utf-8")
            self.record: dict[str, Any] = json.loads(text)
        except (OSError, ValueError) as error:
            raise UserError(f"{folder}: no {record_file} to be read: {error}") from error

    def table(self, name: str) -> pa.Table:
        """Return a table, such as `futures`, `jobs`, `metrics`, or a run's `comparisons`.

        Raises UserError where there is none.
        """
        try:
            table = table_at(self.folder, name)
            return pq.read_table(table) if table.is_dir() else read_parts(table)
        except (OSError, pa.ArrowException) as error:
            raise UserError(f"{self.folder}: no table {name!r} to be read: {error}") from error


def open_run(folder: Path | str) -> Recording:
    """Open what `foretwin drive` left; UserError where the folder holds no run, or one that has
    not come to its end."""
    recording = Recording(path_of("folder", folder), _RUN)
    check_finished(recording.folder)
    return recording


def open_sweep(folder: Path | str) -> Recording:
    """Open what `foretwin sweep` left; UserError where the folder holds no sweep."""
    return Recording(path_of("folder", folder), _SWEEP)
