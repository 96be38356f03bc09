"""Which run is meant: a folder, the id of one, or the latest; the same for every command."""

from __future__ import annotations

from pathlib import Path

from foretwin.contracts.errors import UserError
from foretwin.orchestrator.record.run_state import RECORD, read_record

LATEST = "latest"


def run_folder(run: Path | str, out: Path) -> Path:
    """Return the folder meant by `run`: itself one, the id of one below `out`, or `latest` there.

    Raises UserError, in one line, where that is no folder of a run.
    """
    runs = runs_below(out)
    if str(run) == LATEST:
        if not runs:
            raise UserError(f"{out}: no run is there; --out names the folder of others")
        return runs[0]
    folder = next((one for one in (Path(run), out / run) if one.is_dir()), None)
    if folder is None:
        newest = f"; {LATEST} there is {runs[0].name}" if runs else ""
        raise UserError(f"{run}: no such folder, and {out} holds no run of that name{newest}")
    if not read_record(folder):
        raise UserError(f"{folder}: no folder of a run ({RECORD} is missing or torn)")
    return folder


def runs_below(out: Path) -> list[Path]:
    """Return the folders of the runs below `out`, the newest first: their ids begin with the
    time."""
    if not out.is_dir():
        return []
    return sorted((one.parent for one in out.glob(f"*/{RECORD}")), reverse=True)
