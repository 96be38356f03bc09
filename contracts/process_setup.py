"""What every process is started with, and the router, which needs no more.

The router must start at once and stay small: nothing here knows frames, vehicles or Worlds.
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path
from typing import TypeVar

import msgspec

from foretwin.contracts.campaign import TlsFiles

STARTED_BY = "FORETWIN_STARTED_BY"
"""The variable in which a process is told the id of who started it: who asks for its parent as the
first thing it does asks too late where that was killed just then."""
_Setup = TypeVar("_Setup", bound="ProcessSetup")


class Admission(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Whom a router lets in: users with passwords, where it knows them by these, and what each may
    say, as Zenoh's `access_control` in JSON."""

    access: str
    users_file: str | None = None


class BusSetup(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """How to reach the bus; `lossless` makes every publisher wait rather than drop (lock step)."""

    endpoint: str
    lossless: bool = False
    credentials: str | None = None
    """The file with this process's name and password; see foretwin.contracts.credentials."""
    admits: Admission | None = None
    """Of the router alone; None: whoever comes may say anything."""
    tls: TlsFiles | None = None
    """Who this process is, on a bus over a network: both sides show certificates (mTLS)."""


class ProcessSetup(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What every process knows: the run, its own id, the bus, and where its log goes."""

    run_id: str
    process_id: str
    vehicle_id: str
    bus: BusSetup
    log_file: str
    trace_dir: str | None = None
    """Where it leaves what it did when; None: nowhere. See foretwin.contracts.trace."""
    grace_s: float = 30.0
    """A lost link comes back within this time, and an orchestrator that stood still goes on, or it
    is taken for gone. One that has died is seen at once by those that it started."""


class RouterSetup(ProcessSetup, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The router; it says in `word_file` that it listens, or in one line why it cannot."""

    word_file: str
    folder: str | None = None
    """Where socket and passwords lie: gone with a router whose drive has died."""


def write_setup(setup: ProcessSetup, path: Path) -> None:
    """Write a setup as JSON; one that is there already stays, so that a full disk takes nothing of
    it where a process is started again. Raises OSError."""
    data = msgspec.json.format(msgspec.json.encode(setup))
    if not path.exists() or path.read_bytes() != data:
        path.write_bytes(data)


def read_setup(path: Path, kind: type[_Setup]) -> _Setup:
    """Read a setup of type `kind`; raises msgspec.ValidationError naming the field at fault."""
    return msgspec.json.decode(path.read_bytes(), type=kind)


def parent_pid() -> int:
    """Return whom this process ends with: who started it, though that may have died since.

    What it starts itself is told nothing of it.
    """
    return int(os.environ.pop(STARTED_BY, "") or os.getppid())


def setup_given(kind: type[_Setup], argv: list[str] | None = None) -> tuple[Path, _Setup]:
    """Return the file that a process's `--setup FILE` names, and what it holds.

    Leaves with exit code 2, in one line, where that cannot be read.
    """
    parser = argparse.ArgumentParser()
    parser.add_argument("--setup", type=Path, required=True, help="JSON file written by foretwin")
    file = parser.parse_args(argv).setup
    try:
        return file, read_setup(file, kind)
    except (msgspec.DecodeError, OSError) as problem:
        parser.exit(2, f"{file}: {problem}\n")
