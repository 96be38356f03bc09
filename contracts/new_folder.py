"""Folders that are made for a result, and gone again where there is none."""

from __future__ import annotations

import contextlib
import errno
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

_PLAIN = frozenset({errno.EACCES, errno.EPERM, errno.ENOENT})


@contextlib.contextmanager
def new_folder(path: Path) -> Iterator[None]:
    """Make a folder and those around it; of these, what is empty goes again if anything is raised.

    Raises OSError where it cannot be made.
    """
    made = [folder for folder in (path, *path.parents) if not folder.exists()]
    path.mkdir(parents=True, exist_ok=True)
    try:
        yield
    except BaseException:
        with contextlib.suppress(OSError):  # not empty, or gone already
            for folder in made:
                folder.rmdir()
        raise


@contextlib.contextmanager
def new_files(folder: Path) -> Iterator[None]:
    """Make files in a folder, all of them or none: what is new in it goes if anything is raised.

    Raises OSError where it cannot be made.
    """
    there = set(folder.iterdir()) if folder.is_dir() else set()
    with new_folder(folder):
        try:
            yield
        except BaseException:
            for file in set(folder.iterdir()) - there:
                with contextlib.suppress(OSError):
                    file.unlink()
            raise


@contextlib.contextmanager
def named_in_errors(name: str) -> Iterator[None]:
    """Let the system's errors that name no file, as of a full disk, name what was written."""
    try:
        yield
    except OSError as error:
        if error.errno is None or error.filename is not None:
            raise
        raise OSError(error.errno, os.strerror(error.errno), name) from error


def trouble_with_folder(path: Path) -> str | None:
    """Return why nothing can be written into a folder, made or yet to be made; None where it can.

    Asked before what takes long is begun. It is tried, and leaves nothing: permissions alone do not
    tell of a folder of the system, of a full disk, or of a name that is too long.
    """
    # Path.exists raises where a name is too long.
    there = next(one for one in (path, *path.parents) if os.path.exists(one))  # noqa: PTH110
    try:
        if not there.is_dir():
            return "is no folder" if there == path else f"{there} is no folder"
        _try(there, path)
    except OSError as error:
        # What the system says of its own folders is no such file.
        why = "" if error.errno in _PLAIN else f": {(error.strerror or str(error)).lower()}"
        return f"folder {there} cannot be written to{why}"
    return None


def _try(there: Path, path: Path) -> None:
    with contextlib.ExitStack() as tried:
        if there != path:
            # Under a name of its own: others may ask the same at once, and find nothing half made.
            own = Path(tried.enter_context(tempfile.TemporaryDirectory(dir=there)))
            path = own / path.relative_to(there)
            path.mkdir(parents=True)
        tried.enter_context(tempfile.TemporaryFile(dir=path))
