"""Who a process is on the bus of one host: its name and password, in a file of its own.

    FOLDER/bus            the socket of the run's router
    FOLDER/users          what the router knows: every name with its password
    FOLDER/NAME.json      what one of them shows: worker-w0, car-vehicle, operator, planner, …

The folder is the user's alone and lies where the system keeps what lives no longer than a login,
never in the run's: that is copied, archived and shared.
"""

from __future__ import annotations

import os
import secrets
import shutil
import stat
from collections.abc import Iterable
from pathlib import Path

import msgspec

from foretwin.contracts.errors import UserError

SOCKET, USERS = "bus", "users"
MOST_SOCKET_PATH = 107
"""Bytes that the system takes for a socket's path."""
_OTHERS = 0o077


class Credentials(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A name on the bus and its password."""

    user: str
    password: str


def runtime_folder() -> Path:
    """Return this user's folder for what runs, made where it is not there yet.

    Raises UserError where it is not this user's alone.
    """
    given = os.environ.get("XDG_RUNTIME_DIR")
    folder = Path(given) / "foretwin" if given else Path(f"/tmp/foretwin-{os.getuid()}")
    _make_private(folder)
    return folder


def bus_folder(run_id: str) -> Path:
    """Make the folder of one run's bus and return it; raises UserError where it cannot be made."""
    folder = runtime_folder() / run_id
    _make_private(folder)
    if len(os.fsencode(folder / SOCKET)) > MOST_SOCKET_PATH:
        shutil.rmtree(folder, ignore_errors=True)
        raise UserError(f"{folder / SOCKET}: longer than the {MOST_SOCKET_PATH} bytes of a socket")
    return folder


def _make_private(folder: Path) -> None:
    try:
        folder.mkdir(mode=0o700, parents=False, exist_ok=True)
        found = folder.lstat()
    except OSError as error:
        raise UserError(f"{folder}: {(error.strerror or str(error)).lower()}") from error
    if not stat.S_ISDIR(found.st_mode) or found.st_uid != os.getuid() or found.st_mode & _OTHERS:
        raise UserError(f"{folder}: must be a folder of this user alone (mode 0700); remove it")


def make_credentials(folder: Path, users: Iterable[str]) -> None:
    """Give each user a password of its own, in files that nobody else can read."""
    made = [Credentials(user=user, password=secrets.token_hex(16)) for user in users]
    for one in made:
        _write(credentials_file(folder, one.user), msgspec.json.encode(one))
    lines = "".join(f"{one.user}:{one.password}\n" for one in made)
    _write(folder / USERS, lines.encode())


def credentials_file(folder: Path, user: str) -> Path:
    """Return where a user's name and password lie."""
    return folder / f"{user}.json"


def read_credentials(file: Path) -> Credentials:
    """Read a user's name and password; raises UserError where there are none that may be used."""
    try:
        if file.stat().st_mode & _OTHERS:
            raise UserError(f"{file}: others can read it; it must be this user's alone (mode 0600)")
        return msgspec.json.decode(file.read_bytes(), type=Credentials)
    except (OSError, msgspec.DecodeError) as error:
        raise UserError(f"{file}: no credentials for a bus ({error})") from error


def _write(file: Path, data: bytes) -> None:
    descriptor = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    with os.fdopen(descriptor, "wb") as opened:
        opened.write(data)
