"""Finds a drive that goes on, and how somebody beside it joins its bus."""

from __future__ import annotations

import json
from pathlib import Path
from typing import NamedTuple

from foretwin.contracts.credentials import credentials_file
from foretwin.contracts.errors import UserError
from foretwin.contracts.process import is_held
from foretwin.contracts.process_setup import BusSetup
from foretwin.contracts.terminal import command_line


class RunningDrive(NamedTuple):
    """A drive whose record says that it goes on, and whose processes do."""

    run_id: str
    folder: Path
    endpoint: str
    credentials: Path | None
    """Where the names and passwords of its bus lie; None where nobody is asked for one."""

    def bus(self, user: str) -> BusSetup:
        """Return how somebody joins: `operator`, who steers, or `planner`, a driving stack."""
        if self.credentials is None:
            return BusSetup(endpoint=self.endpoint)
        file = credentials_file(self.credentials, user)
        return BusSetup(endpoint=self.endpoint, credentials=str(file))


def newest_running(out: Path) -> RunningDrive:
    """Return the newest run below `out` that goes on; raises UserError where none does."""
    folders = sorted(out.iterdir(), reverse=True) if out.is_dir() else []
    for folder in folders:
        try:
            return running_drive(folder)
        except UserError:
            continue
    raise UserError(f"{out}: no drive is running there; --run names one elsewhere")


def running_drive(folder: Path) -> RunningDrive:
    """Return the drive of a run's folder; raises UserError where it is none, has ended or was
    killed: who drives holds the lock on the log."""
    file = folder / "run.json"
    try:
        record = json.loads(file.read_text(encoding="utf-8"))
        run_id, exit_word = str(record["run_id"]), str(record["exit"])
    except (OSError, ValueError, KeyError, TypeError):
        raise UserError(f"{folder}: no folder of a run (run.json is missing or torn)") from None
    if exit_word != "running":
        raise UserError(f"{folder}: the run has ended ({exit_word})")
    if not isinstance(record.get("endpoint"), str):
        raise UserError(f"{file}: does not say where the drive listens")
    log = folder / "log.jsonl"
    if not (log.is_file() and is_held(log)):
        how = f"`{command_line('recover', folder)}` makes its results readable"
        raise UserError(f"{folder}: the drive was killed; {how}")
    shown = record.get("credentials")
    credentials = Path(shown) if isinstance(shown, str) else None
    return RunningDrive(run_id, folder, record["endpoint"], credentials)
