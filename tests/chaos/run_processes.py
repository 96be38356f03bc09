"""The processes of one run, by what the run itself tells: who holds which of its files."""

from __future__ import annotations

import contextlib
import os
import signal
from pathlib import Path
from typing import NamedTuple

from foretwin.contracts.process_name import PREFIX
from tests.system.foretwin_command import is_running

MARK = "FORETWIN_CHAOS_DRIVE"
"""In the environment of everything that a drive starts."""


class Member(NamedTuple):
    """A process of a run: its name there, and its id."""

    name: str
    pid: int

    @property
    def kind(self) -> str:
        """What it is called without its number: `w` of `w0`."""
        return self.name.rstrip("0123456789")


def members(run: Path, mark: str, command_pid: int) -> list[Member]:
    """Return the processes of a run that live, sorted by name.

    Who was started with a setup is named by it. The command is the supervisor; who was forked from
    it is named by what the system calls it. What else carries the mark is `other`. The run's log is
    not asked: on a full disk it tells nothing.
    """
    names = {pid: _setup_name(pid, run) or _fork_name(pid) or "other" for pid in marked(mark)}
    if command_pid in names:
        names[command_pid] = "supervisor"
    return sorted(Member(name, pid) for pid, name in names.items())


def marked(mark: str) -> list[int]:
    """Return the processes that carry a mark and are no zombies."""
    sought = f"{MARK}={mark}".encode()
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            if sought in (folder / "environ").read_bytes().split(b"\0"):
                found.append(int(folder.name))
    return sorted(pid for pid in found if is_running(pid))


def end_all(mark: str) -> list[str]:
    """Kill what still carries a mark; returns what that was, in words."""
    left = []
    for pid in marked(mark):
        with contextlib.suppress(OSError):
            words = Path(f"/proc/{pid}/cmdline").read_bytes().replace(b"\0", b" ")
            left.append(f"{pid}: {words.decode(errors='replace')[:160]}")
            os.kill(pid, signal.SIGKILL)
    return left


def _setup_name(pid: int, run: Path) -> str | None:
    """Return the name of the setup below `run` that a process was started with."""
    with contextlib.suppress(OSError, ValueError):
        words = Path(f"/proc/{pid}/cmdline").read_bytes().decode(errors="replace").split("\0")
        setup = Path(words[words.index("--setup") + 1])
        if setup.parent.parent == run:
            return setup.stem
    return None


def _fork_name(pid: int) -> str | None:
    """Return what a process is called that was started with no setup of its own."""
    with contextlib.suppress(OSError):
        words = Path(f"/proc/{pid}/cmdline").read_bytes().split(b"\0")
        called = Path(f"/proc/{pid}/comm").read_text(encoding="utf-8").strip()
        if called.startswith(PREFIX) and b"--setup" not in words:
            return called.removeprefix(PREFIX)
    return None
