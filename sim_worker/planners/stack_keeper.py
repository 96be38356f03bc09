"""Holds a program that is not foretwin's, so that it ends, with all that it has started, once
whoever started this has closed the pipe that is its standard input, or is gone.

Run as a file with the standard library alone: it has to be there at once. Exits as the program
does, by 128 and the signal's number where a signal ended it, 127 where there is no such program.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import select
import signal
import subprocess
import sys
import threading

GRACE_S = 2.0
"""Between being told to end and being ended."""
NOT_FOUND, BY_SIGNAL = 127, 128
"""Exit codes, as of a shell."""
_PR_SET_PDEATHSIG = 1


def main(command: list[str]) -> int:
    """Run a command until it ends or nobody wants it any more; returns the exit code."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        # A session of its own can be ended as a whole; there is no other thread yet.
        child = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, start_new_session=True, preexec_fn=_end_with_keeper
        )
    except OSError as error:
        sys.stderr.write(f"{command[0]}: {(error.strerror or str(error)).lower()}\n")
        return NOT_FOUND
    ended, told = os.pipe()

    def wait() -> None:
        child.wait()
        os.write(told, b".")

    threading.Thread(target=wait, daemon=True).start()
    wanted = True
    while wanted:
        readable, _, _ = select.select([sys.stdin, ended], [], [])
        if ended in readable:
            break
        wanted = bool(os.read(sys.stdin.fileno(), 1))
    else:
        _signal(child.pid, signal.SIGTERM)
        _signal(child.pid, signal.SIGCONT)
        select.select([ended], [], [], GRACE_S)
    _signal(child.pid, signal.SIGKILL)
    code = child.wait()
    return BY_SIGNAL - code if code < 0 else code


def _end_with_keeper() -> None:
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    with contextlib.suppress(AttributeError, OSError):
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)


def _signal(session: int, number: int) -> None:
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(session, number)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
