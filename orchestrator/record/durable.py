"""Files that are there whole or not at all, also after a power cut."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from foretwin.contracts.partial_file import partial_file

WRITING = ".writing"
"""What the name of a file ends in until it is whole."""


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Give the name of a file to write; once it is written, and on the disk, it is called `path`.

    That the new name outlives a power cut takes `sync_folder`. Raises OSError; see `partial_file`.
    """
    with partial_file(path, ending=WRITING) as partial:
        yield partial
        _sync(partial)


def sync_folder(folder: Path) -> None:
    """Bring the names in a folder to the disk. Raises OSError."""
    _sync(folder)


def _sync(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
