"""How long others kept a process from running: what a busy machine adds to the time it takes."""

from __future__ import annotations

import contextlib
import subprocess
import time
from pathlib import Path


def runqueue_wait_s(pid: int) -> float:
    """Return for how long the process's most hindered thread was ready and did not run.

    From /proc/PID/task/*/schedstat (Linux: run time, run-queue wait, slices); 0 elsewhere.
    """
    most_ns = 0
    for thread in Path(f"/proc/{pid}/task").glob("*/schedstat"):
        with contextlib.suppress(OSError):
            most_ns = max(most_ns, int(thread.read_text().split()[1]))
    return most_ns * 1e-9


def unhindered_wait_s(process: subprocess.Popen[bytes], deadline_s: float) -> float:
    """Wait for a process to end; return the seconds that took, less those it was kept waiting.

    Raises subprocess.TimeoutExpired after `deadline_s`.
    """
    begun_s, before_s = time.monotonic(), runqueue_wait_s(process.pid)
    kept_s = 0.0
    while True:
        try:
            process.wait(0.02)
        except subprocess.TimeoutExpired:
            if time.monotonic() - begun_s > deadline_s:
                raise
            kept_s = max(kept_s, runqueue_wait_s(process.pid) - before_s)
            continue
        return time.monotonic() - begun_s - kept_s
