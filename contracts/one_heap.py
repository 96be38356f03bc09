"""One heap for all threads of a process that lives for a day, and no more of it than is used."""

from __future__ import annotations

import contextlib
import ctypes
import os
import sys

_M_ARENA_MAX = -8
"""glibc, malloc.h."""
GIVE_BACK_EVERY_S = 30.0


def share_one_heap() -> None:
    """Let threads that begin from now on allocate from the one heap that there is.

    glibc gives threads heaps of their own, up to eight for each processor. The bus's threads
    allocate what ours free and the other way round, and what is free in one heap is of no use to
    another: processes grew for hours without holding more. Elsewhere threads keep theirs.

    Arrow has a heap of its own besides (mimalloc), which gives nothing back: it takes from this
    one, here and in processes that are started from here.
    """
    os.environ["ARROW_DEFAULT_MEMORY_POOL"] = "system"
    if (arrow := sys.modules.get("pyarrow")) is not None:
        arrow.set_memory_pool(arrow.system_memory_pool())
    with contextlib.suppress(AttributeError, OSError):
        ctypes.CDLL(None).mallopt(_M_ARENA_MAX, 1)


class FreeMemory:
    """Gives memory that a process holds and does not use back to the system, now and then.

    glibc keeps what lies free between what is used: a process that lives for a day then holds the
    most that it ever needed at one time, in every part of its heap. It takes a millisecond.
    """

    def __init__(self, now_s: float) -> None:
        """`now_s` is the monotonic time."""
        self._next_s = now_s + GIVE_BACK_EVERY_S

    def look(self, now_s: float) -> bool:
        """Give back where it is time to; call it often. Returns whether it was time."""
        if now_s < self._next_s:
            return False
        self._next_s = now_s + GIVE_BACK_EVERY_S
        with contextlib.suppress(AttributeError, OSError):
            ctypes.CDLL(None).malloc_trim(0)
        return True
