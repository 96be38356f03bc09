"""One writer at a time in a folder: a lock that ends with its process, whatever ends that."""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from foretwin.contracts.errors import UserError

LOCK = "sweep.lock"
"""Stays where it is: who removed it could remove another's."""


@contextmanager
def folder_lock(
    folder: Path, *, name: str = LOCK, option: str = "--out", who: str = "sweep"
) -> Iterator[None]:
    """Hold the lock of an existing folder; raises UserError naming the process that has it."""
    descriptor = os.open(folder / name, os.O_RDWR | os.O_CREAT, 0o644)
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            holder = os.pread(descriptor, 32, 0).decode(errors="replace").strip()
            raise UserError(
                f"{option} {folder}: another {who} writes there, process {holder or 'unknown'}"
            ) from None
        os.ftruncate(descriptor, 0)
        os.pwrite(descriptor, f"{os.getpid()}\n".encode(), 0)
        yield
        os.ftruncate(descriptor, 0)
    finally:
        os.close(descriptor)
