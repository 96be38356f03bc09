"""Folders that are made for a result, and gone again where there is none."""

from __future__ import annotations

import contextlib
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
