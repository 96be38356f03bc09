"""Lets a program of others end with the process that started it, whatever ends that."""

from __future__ import annotations

import sys
from collections.abc import Sequence

_STARTS = """
import ctypes, os, signal, sys
try:
    ctypes.CDLL(None).prctl(1, signal.SIGTERM, 0, 0, 0)  # PR_SET_PDEATHSIG
except (AttributeError, OSError):
    pass
if os.getppid() == int(sys.argv[1]):
    os.execv(sys.argv[2], sys.argv[2:])
"""


def ends_with_parent(command: Sequence[str], *, parent: int) -> list[str]:
    """Return what to start instead of `command`, a program's path and its arguments.

    Linux sends it SIGTERM once the thread that has started it is gone; elsewhere it is as before.
    Never by a hook between fork and exec: other threads may hold locks then.
    """
    return [sys.executable, "-I", "-S", "-c", _STARTS, str(parent), *command]
