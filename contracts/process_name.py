"""What a process is called where the system lists processes, in `top` for one."""

from __future__ import annotations

import contextlib
import ctypes

_PR_SET_NAME = 15
"""Linux, prctl(2)."""
_MOST_CHARACTERS = 15
PREFIX = "ft-"


def name_process(process_id: str) -> None:
    """Let the system call this process, and the threads that it starts from now on, by its id."""
    name = f"{PREFIX}{process_id}".encode()[:_MOST_CHARACTERS]
    with contextlib.suppress(AttributeError, OSError):  # elsewhere it keeps its command's name
        ctypes.CDLL(None).prctl(_PR_SET_NAME, ctypes.c_char_p(name), 0, 0, 0)
