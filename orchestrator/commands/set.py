"""`foretwin set KEY=VALUE`: finds the running drive and asks it to change."""

from __future__ import annotations

import json
from pathlib import Path
from typing import NamedTuple

from foretwin.contracts.bus import Bus, BusUnreachable, ZenohBus, ask
from foretwin.contracts.errors import UserError
from foretwin.contracts.setup import BusSetup
from foretwin.contracts.tuning import SetReply, SetRequest

ANSWER_S = 120.0
"""A change waits for the drive to begin and for the round in progress; that may take a while."""


class RunningDrive(NamedTuple):
    """A drive whose record says that it goes on."""

    run_id: str
    folder: Path
    endpoint: str


def set_in_drive(assignment: str, *, run: Path | None, out: Path) -> str:
    """Ask the drive `run`, or the newest running one below `out`; returns what counts now.

    Raises UserError, in one line, where the assignment or the run cannot be used or the drive
    refuses.
    """
    key, equals, value = assignment.partition("=")
    if not (equals and key.strip() and value.strip()):
        raise UserError(f"{assignment}: must be KEY=VALUE, such as role.ego=shadow")
    drive = newest_running(out) if run is None else running_drive(_folder(run, out))
    request = SetRequest(key=key.strip(), value=value.strip())
    try:
        with ZenohBus(BusSetup(endpoint=drive.endpoint)) as bus:
            return f"{drive.run_id}: {ask_drive(bus, drive.run_id, request)}"
    except BusUnreachable:
        raise UserError(
            f"{drive.folder}: nobody listens at {drive.endpoint}; was the drive killed?"
        ) from None


def ask_drive(bus: Bus, run_id: str, request: SetRequest, *, timeout_s: float = ANSWER_S) -> str:
    """Return what counts now; raises UserError where the drive refuses or does not answer."""
    try:
        reply: SetReply = ask(bus, "set", request, timeout_s=timeout_s, run=run_id)
    except TimeoutError as silent:
        raise UserError(f"run {run_id} does not answer: {silent}") from None
    if not reply.done:
        raise UserError(reply.text)
    return reply.text


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
    """Return the drive of a run's folder; raises UserError where it is none or has ended."""
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
    return RunningDrive(run_id, folder, record["endpoint"])


def _folder(run: Path, out: Path) -> Path:
    """Return the folder meant by `run`: a folder, or the id of one below `out`."""
    return run if run.is_dir() or len(run.parts) > 1 else out / run
