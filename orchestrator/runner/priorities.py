"""Who gives way to whom on the processors."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path


def gives_way(pid: int, nice: int, *, processes: Path = Path("/proc")) -> bool:
    """Let a running process give way, with all threads and processes of a session that it leads.

    Where Linux shares the processors between sessions first (autogroup, the default of many
    distributions), niceness counts within a session alone: there the session gets it too, and may
    get back what it had, which niceness itself does not grant to everybody. False says that this
    must be tried again.
    """
    try:
        if os.getsid(pid) != pid:
            os.setpriority(os.PRIO_PROCESS, pid, nice)  # others of its session were not asked
            return True
        with contextlib.suppress(PermissionError):
            os.setpriority(os.PRIO_PGRP, pid, nice)
        (processes / str(pid) / "autogroup").write_text(f"{nice}\n", encoding="ascii")
    except BlockingIOError:
        return False  # the kernel takes one such change every 100 ms
    except OSError:
        return True  # no autogroup here, or the process is gone
    return True
