"""Threads that the bus's library calls back on: what Python knows of one is kept between calls.

The library's threads are none of Python's. CPython makes a state for such a thread as it comes, and
takes it down again as it leaves: memory is mapped, touched for the first time and unmapped for each
sample, a seventh of what it costs to receive one (`python -m tests.benchmarks received_samples`).
"""

from __future__ import annotations

import contextlib
import ctypes
import threading


class _ThreadKnown(threading.local):
    """What is known of each thread; goes with its state."""

    kept = False


_known = _ThreadKnown()


def keep_thread_state() -> None:
    """Let Python keep this thread's state until the process ends; call it in each callback.

    Once more entered than left, the outermost leaving finds somebody still within
    (PyGILState_Ensure and PyGILState_Release, docs.python.org/3.11/c-api/init.html). Other
    interpreters than CPython have no such states: nothing happens there.
    """
    if not _known.kept:
        _known.kept = True
        with contextlib.suppress(AttributeError):
            ctypes.pythonapi.PyGILState_Ensure()
