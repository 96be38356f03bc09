"""Files that others find whole or not at all."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

PARTIAL = ".partial"
"""What the name of a file ends in until it is whole."""


@contextmanager
def partial_file(path: Path, *, ending: str = PARTIAL) -> Iterator[Path]:
    """Give the name of a file to write, which takes the place of `path` once it is written.

    Whoever looks meanwhile sees what was there before. If anything is raised nothing of it stays.
    Raises OSError.
    """
    partial = path.with_name(path.name + ending)
    try:
        yield partial
        partial.replace(path)
    except BaseException:
        with suppress(OSError):
            partial.unlink(missing_ok=True)
        raise
