"""Folders that are made for a result, and gone again where there is none."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path


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


def trouble_with_folder(path: Path) -> str | None:
    """Return why nothing can be written into a folder, made or yet to be made; None where it can.

    Asked before what takes long is begun.
    """
    there = next(one for one in (path, *path.parents) if one.exists())
    if not there.is_dir():
        return "is no folder" if there == path else f"{there} is no folder"
    if not os.access(there, os.W_OK | os.X_OK):
        return f"folder {there} cannot be written to"
    return None
