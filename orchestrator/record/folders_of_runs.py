"""Which folders are runs and sweeps, and which files their tables are, without opening any."""

from __future__ import annotations

import os
from pathlib import Path

from foretwin.contracts.errors import UserError
from foretwin.orchestrator.record.run_folder import METRICS_FILE, SUMMARY, SWEPT_TABLES
from foretwin.orchestrator.record.run_state import RECORD, RESULTS
from foretwin.orchestrator.record.table_parts import table_of

_PARQUET = ".parquet"


def folders_of_runs(given: Path) -> list[Path]:
    """Return the folder of a run or sweep itself, or those in it or one folder deeper.

    Raises FileNotFoundError where there is no such folder, UserError where it holds none.
    """
    if not given.is_dir():
        raise FileNotFoundError(f"{given}: no such folder")
    if is_run_folder(given):
        return [given]
    within = _folders_in(given)
    found = [path for path in within if is_run_folder(path)]
    deeper = (path for path in within if not is_run_folder(path))
    found += [path for folder in deeper for path in _folders_in(folder) if is_run_folder(path)]
    if not found:
        raise UserError(f"{given}: neither a run nor a sweep, nor a folder of these")
    return sorted(found)


def is_run_folder(folder: Path) -> bool:
    """Whether a drive or sweep wrote there."""
    return any((folder / name).exists() for name in (RECORD, SUMMARY, RESULTS))


def table_files(folder: Path) -> dict[str, tuple[Path, ...]]:
    """Return the files of each table of a run or sweep, the oldest first."""
    if (folder / SUMMARY).exists():
        found = {name: _parquet_in(folder / at) for name, at in SWEPT_TABLES.items()}
        found["metrics"] = [path for path in (folder / METRICS_FILE,) if path.exists()]
    else:
        found = {}
        for path in _parquet_in(folder / RESULTS):
            found.setdefault(table_of(path) or path.stem, []).append(path)
        for name, paths in found.items():
            found[name] = sorted(paths, key=_by_number) if len(paths) > 1 else paths
    return {name: tuple(paths) for name, paths in found.items() if paths}


def _parquet_in(folder: Path) -> list[Path]:
    try:
        with os.scandir(folder) as entries:
            names = sorted(one.name for one in entries if one.name.endswith(_PARQUET))
    except OSError:
        return []
    return [folder / name for name in names]


def _by_number(part: Path) -> tuple[bool, int, str]:
    """Order parts as they were written: the one without a number is the last."""
    return table_of(part) is None, len(part.stem), part.stem


def _folders_in(folder: Path) -> list[Path]:
    try:
        return sorted(path for path in folder.iterdir() if path.is_dir())
    except PermissionError:
        return []
