"""Folders for a while, which outlive nobody: the next one to make such a folder removes those whose
owner is gone.

Who owns a folder holds a lock in it, which ends with the process, whatever ends that. A folder that
nobody holds, and only such a one, is left from a kill.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import shutil
import stat
import tempfile
from collections.abc import Iterator
from pathlib import Path

LOCK = "owner.lock"
_ATTEMPTS = 100


class OwnedFolder:
    """A folder that is this process's, and that of its forks, until `remove` or their end."""

    def __init__(self, path: Path, lock: int) -> None:
        self.path = path
        self._lock: int | None = lock

    def keep_over_exec(self) -> None:
        """Let the program that this process becomes own it."""
        if self._lock is not None:
            os.set_inheritable(self._lock, True)

    def remove(self) -> None:
        """Leave nothing."""
        shutil.rmtree(self.path, ignore_errors=True)
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None


@contextlib.contextmanager
def temporary_folder(prefix: str, *, within: Path | None = None) -> Iterator[Path]:
    """Give a folder of this user alone, gone afterwards; among the system's temporary ones, or
    `within` another.

    Those of the same prefix that a kill left there go first. Raises OSError.
    """
    owned = make_temporary(prefix, within=within)
    try:
        yield owned.path
    finally:
        owned.remove()


def make_temporary(prefix: str, *, within: Path | None = None) -> OwnedFolder:
    """Make such a folder for as long as this process lives; raises OSError."""
    parent = within or Path(tempfile.gettempdir())
    remove_left(parent, prefix)
    for _ in range(_ATTEMPTS):
        owned = own(Path(tempfile.mkdtemp(prefix=prefix, dir=parent)))
        if owned is not None:
            return owned
    raise FileExistsError(f"{parent}: no folder {prefix}… can be made there")


def own(folder: Path) -> OwnedFolder | None:
    """Take a folder as this process's; None where another takes it, or has just removed it."""
    lock = folder / LOCK
    try:
        descriptor = os.open(lock, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
    except FileNotFoundError:
        return None
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        if os.path.samestat(os.fstat(descriptor), lock.lstat()):
            return OwnedFolder(folder, descriptor)
    except (BlockingIOError, FileNotFoundError):
        pass
    os.close(descriptor)
    return None


def remove_left(parent: Path, prefix: str = "") -> list[Path]:
    """Remove this user's folders of that prefix whose owner is gone; returns them."""
    with contextlib.suppress(OSError):
        found = [Path(entry.path) for entry in os.scandir(parent) if entry.name.startswith(prefix)]
        return [folder for folder in found if _remove_left(folder)]
    return []


def _remove_left(folder: Path) -> bool:
    try:
        about = folder.lstat()
        if not stat.S_ISDIR(about.st_mode) or about.st_uid != os.getuid():
            return False
        if not (folder / LOCK).exists():
            return False  # not one of these, or not owned yet
    except OSError:
        return False
    owned = own(folder)
    if owned is None:
        return False
    owned.remove()
    return True
