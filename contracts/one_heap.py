"""One heap for all threads of a process that lives for a day."""

from __future__ import annotations

import contextlib
import ctypes

_M_ARENA_MAX = -8
"""glibc, malloc.h."""


def share_one_heap() -> None:
    """Let threads that begin from now on allocate from the one heap that there is.

    glibc gives threads heaps of their own, up to eight for each processor. The bus's threads
    allocate what ours free and the other way round, and what is free in one heap is of no use to
    another: processes grew for hours without holding more. Elsewhere nothing happens.
    """
    with contextlib.suppress(AttributeError, OSError):
        ctypes.CDLL(None).mallopt(_M_ARENA_MAX, 1)
