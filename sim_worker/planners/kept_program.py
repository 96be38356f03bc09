"""A program that is not foretwin's, started such that it ends with who started it."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import BinaryIO

from foretwin.sim_worker.planners import stack_keeper

_MOST_LOG_BYTES, _MOST_CHARACTERS = 4096, 200
"""How much of a log is looked at for its last line, and how much of that is told."""


class KeptProgram:
    """One life of a program, from its start; what it prints is appended to the file `log`.

    Raises OSError where it cannot be started. `folder` is where it runs, None: here; `told` is
    added to its environment.
    """

    def __init__(
        self, command: Sequence[str], *, folder: str | None, log: Path, told: Mapping[str, str]
    ) -> None:
        self._log = log
        with _appended(log) as said:
            self._said_before = said.tell()
            self._keeper = subprocess.Popen(
                [sys.executable, "-I", "-S", stack_keeper.__file__, *command],
                cwd=folder,
                stdin=subprocess.PIPE,
                stdout=said,
                stderr=said,
                env={**os.environ, **told},
            )

    @property
    def pid(self) -> int:
        """The operating system's id of the process that keeps it."""
        return self._keeper.pid

    @property
    def has_ended(self) -> bool:
        """Whether it has ended."""
        return self._keeper.poll() is not None

    def ending(self) -> str:
        """Wait for its end and return in words how it ended, with the last line that it printed."""
        code = self._keeper.wait()
        self.tell_to_end()  # There is a pipe to it still.
        signal = -code if code < 0 else code - stack_keeper.BY_SIGNAL
        how = f"signal {signal}" if signal > 0 else f"exit code {code}"
        said = self._last_line()
        return f"ended by {how}{f' ({said})' if said else ''}"

    def tell_to_end(self) -> None:
        """Let it end, and whatever it has started, without waiting for that."""
        assert self._keeper.stdin is not None
        self._keeper.stdin.close()

    def end(self) -> None:
        """End it, and whatever it has started."""
        self.tell_to_end()
        try:
            self._keeper.wait(timeout=2.0 * stack_keeper.GRACE_S)
        except subprocess.TimeoutExpired:
            self._keeper.kill()
            self._keeper.wait()

    def _last_line(self) -> str:
        with contextlib.suppress(OSError), self._log.open("rb") as file:
            size = self._log.stat().st_size
            file.seek(max(self._said_before, size - _MOST_LOG_BYTES))
            lines = file.read().decode(errors="replace").split("\n")
            found = next((line.strip() for line in reversed(lines) if line.strip()), "")
            return found[:_MOST_CHARACTERS]
        return ""


def _appended(file: Path) -> BinaryIO:
    """Open a log to append to; where it cannot be, what is said is lost."""
    with contextlib.suppress(OSError):
        file.parent.mkdir(parents=True, exist_ok=True)
        return file.open("ab")
    return Path(os.devnull).open("ab")
