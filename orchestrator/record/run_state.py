"""Whether a run goes on, has come to its end, or ended badly: told from its folder alone."""

from __future__ import annotations

import fcntl
import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from foretwin.contracts.errors import UserError
from foretwin.contracts.terminal import command_line
from foretwin.orchestrator.record.derive import streams_in
from foretwin.orchestrator.record.durable import sync_folder, whole_file

RECORD, RESULTS, LOG, PROCESSES = "run.json", "results", "log.jsonl", "processes"
RUNNING = "running"


class RunGoesOnError(UserError):
    """The drive of a run has not ended."""


@contextmanager
def run_lock(folder: Path) -> Iterator[None]:
    """Hold a run's folder as the one who writes there; ends with the process, whatever ends that.

    What is locked is the log: there from the first moment on, and never replaced. Raises
    RunGoesOnError where another process holds it, UserError where nothing can be written there.
    """
    try:
        descriptor = os.open(folder / LOG, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
    except OSError as error:
        why = (error.strerror or str(error)).lower()
        raise UserError(f"{folder}: nothing can be written there: {why}") from error
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise RunGoesOnError(f"{folder}: the drive still runs") from None
        yield
    finally:
        os.close(descriptor)


def is_locked(file: Path) -> bool:
    """Whether a process holds the lock of a file; nothing is written, nor made where it lacks."""
    try:
        with file.open("rb") as held:
            fcntl.flock(held, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        return False
    return False


def read_record(folder: Path) -> dict[str, Any]:
    """Return what run.json says, nothing where it is missing or torn."""
    try:
        record = json.loads((folder / RECORD).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return record if isinstance(record, dict) else {}


def is_unfinished(folder: Path) -> bool:
    """Whether a folder is that of a run whose tables or record are not yet as a drive's end leaves
    them."""
    if read_record(folder).get("exit") == RUNNING:
        return True
    return bool(streams_in(folder / RESULTS))


def made_by_recover(folder: Path) -> str:
    """Return how what could not be written of a run is had from what was, for a trouble's end."""
    return f"`{command_line('recover', folder)}` makes it of what was written"


def check_finished(folder: Path) -> None:
    """Raise UserError, saying what to do, for a run that goes on or never came to its end."""
    if not is_unfinished(folder):
        return
    with run_lock(folder):
        pass
    if is_unfinished(folder):  # else it has ended since
        raise UserError(
            f"{folder}: the drive never came to its end: "
            f"`{command_line('recover', folder)}` makes its results readable"
        )


def write_record(record: dict[str, Any], file: Path) -> None:
    """Write run.json in place of what is there; on a full disk over it. Raises OSError."""
    data = (json.dumps(record, indent=2, ensure_ascii=False) + "\n").encode()
    try:
        with whole_file(file) as partial:
            partial.write_bytes(data)
        sync_folder(file.parent)
    except OSError:
        with file.open("r+b" if file.exists() else "wb") as target:
            target.write(data)
            target.truncate()
