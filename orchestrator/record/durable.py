"""Files that are there whole or not at all, also after a power cut."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

WRITING = ".writing"
"""What the name of a file ends in until it is whole."""


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Give the name of a file to write; once it is written, and on the disk, it is called `path`.

    Whoever looks meanwhile sees what was there before. On an error nothing of it stays. That the
    new name outlives a power cut takes `sync_folder`. Raises OSError.
    """
    partial = path.with_name(path.name + WRITING)
    try:
        yield partial
        _sync(partial)
        partial.replace(path)
    except BaseException:
        with suppress(OSError):
            partial.unlink(missing_ok=True)
        raise


def sync_folder(folder: Path) -> None:
    """Bring the names in a folder to the disk. Raises OSError."""
    _sync(folder)


def _sync(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
