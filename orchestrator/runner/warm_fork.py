"""Forks a process that has everything read already: what it would import and read lies in memory.

Only a process that no thread of ours runs in can be forked: another thread's locks stay locked in
the child, and a Zenoh session does not survive it. Those of OpenBLAS and of Arrow's allocator put
themselves right (`pthread_atfork`).
"""

from __future__ import annotations

import contextlib
import gc
import logging
import os
import select
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterable
from pathlib import Path

log = logging.getLogger("orchestrator")

_PUT_THEMSELVES_RIGHT = frozenset({"jemalloc_bg_thd"})


class ForkedProcess:
    """A process forked from this one; see Child of the supervisor."""

    def __init__(self, pid: int) -> None:
        self.pid = pid
        self.ended = os.pidfd_open(pid)
        """A descriptor that can be read from once the process has ended."""
        self._code: int | None = None

    def poll(self) -> int | None:
        """Return the exit code, negative for a signal, None while it runs."""
        if self._code is None:
            pid, status = os.waitpid(self.pid, os.WNOHANG)
            if pid:
                self._code = os.waitstatus_to_exitcode(status)
                os.close(self.ended)
        return self._code

    def send_signal(self, sig: int) -> None:
        """Send a signal, unless it has ended."""
        if self.poll() is None:
            with contextlib.suppress(ProcessLookupError):
                os.kill(self.pid, sig)

    def wait(self, timeout: float | None = None) -> int:
        """Wait for the end; raises subprocess.TimeoutExpired."""
        if self.poll() is None:
            select.select([self.ended], [], [], timeout)
        code = self.poll()
        if code is None:
            raise subprocess.TimeoutExpired("a forked process", timeout or 0.0)
        return code

    def kill(self) -> None:
        """End it at once, and wait until it has."""
        self.send_signal(signal.SIGKILL)
        self.wait()


def trouble_with_forking() -> str | None:
    """Return why this process must not be forked, None where nothing is against it."""
    ours = [
        thread.name for thread in threading.enumerate() if thread is not threading.main_thread()
    ]
    if ours:
        return f"threads run in it: {', '.join(ours)}"
    foreign = sorted(set(_thread_names()) - {_own_name()} - _PUT_THEMSELVES_RIGHT)
    return f"threads of a library run in it: {', '.join(foreign)}" if foreign else None


def forked(work: Callable[[], int]) -> ForkedProcess:
    """Run `work` in a fork of this process, which leaves with the exit code that it returns.

    What `work` raises is logged and is exit code 1. Raises RuntimeError where forking is not safe.
    """
    trouble = trouble_with_forking()
    if trouble is not None:
        raise RuntimeError(f"this process cannot be forked: {trouble}")
    _flush()
    gc.freeze()  # what is read already stays shared: the collector does not write to it
    pid = os.fork()
    if pid:
        try:
            return ForkedProcess(pid)
        except OSError:  # no descriptor to see its end by
            os.kill(pid, signal.SIGKILL)
            os.waitpid(pid, 0)
            raise
    code = 1
    try:
        code = work()
    except BaseException:
        log.exception("a forked process ended by an error")
    finally:
        _flush()
        os._exit(code)


def _flush() -> None:
    for stream in (sys.stdout, sys.stderr):
        # A terminal that is gone, a full disk; or none at all, as the command was started without.
        with contextlib.suppress(OSError, ValueError, AttributeError):
            stream.flush()


def _thread_names() -> Iterable[str]:
    for task in Path("/proc/self/task").iterdir():
        with contextlib.suppress(OSError):  # it has ended since
            yield (task / "comm").read_text(encoding="utf-8").strip()


def _own_name() -> str:
    """Return how the main thread is called, and so each that it started without another name."""
    return Path("/proc/self/comm").read_text(encoding="utf-8").strip()
