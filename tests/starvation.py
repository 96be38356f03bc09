"""How long others kept processes from running: what a busy machine adds to the time they take.

A stated limit holds for the time in which the processes concerned could run. On a machine with
nothing else to do that is all of it, and nothing is taken off.
"""

from __future__ import annotations

import contextlib
import os
import subprocess
import threading
import time
from collections.abc import Iterable, Iterator
from pathlib import Path

_LOOK_EVERY_S = 0.05


class KeptWaiting:
    """Adds up how long processes were ready and did not run, in `seconds`.

    Of each process its most hindered thread counts, and they add up: in a chain of processes each
    waits in its turn. Time that a hypervisor took for other machines is counted too. From
    /proc/PID/task/*/schedstat and /proc/stat (Linux); 0 elsewhere.
    """

    def __init__(self, pids: Iterable[int]) -> None:
        self._pids = tuple(pids)
        self._begun: dict[Path, int] = {}
        self._most_ns: dict[int, int] = dict.fromkeys(self._pids, 0)
        self._stolen_s = _stolen_s()
        for pid in self._pids:
            self._begun |= _waits_ns(pid)

    def look(self) -> None:
        """Take in what has been added; of those that end, up to the look before."""
        for pid in self._pids:
            for thread, wait_ns in _waits_ns(pid).items():
                kept_ns = wait_ns - self._begun.get(thread, 0)
                self._most_ns[pid] = max(self._most_ns[pid], kept_ns)

    @property
    def seconds(self) -> float:
        """For how long they were kept waiting so far."""
        return sum(self._most_ns.values()) * 1e-9 + _stolen_s() - self._stolen_s


@contextlib.contextmanager
def kept_waiting(*pids: int) -> Iterator[KeptWaiting]:
    """Watch this process and others, with the children they have now, as long as the block runs."""
    everybody = {os.getpid(), *pids}
    for pid in pids:
        everybody |= children(pid)
    kept, over = KeptWaiting(everybody), threading.Event()

    def watch() -> None:
        while not over.wait(_LOOK_EVERY_S):
            kept.look()

    thread = threading.Thread(target=watch, daemon=True)
    thread.start()
    try:
        yield kept
    finally:
        over.set()
        thread.join()
        kept.look()


def children(pid: int) -> set[int]:
    """Return the processes that a process has started and that run, and theirs."""
    parents: dict[int, int] = {}
    for file in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            parents[int(file.parent.name)] = int(file.read_text().rsplit(")", 1)[1].split()[1])
    found: set[int] = set()
    while more := {child for child, parent in parents.items() if parent in {pid, *found}} - found:
        found |= more
    return found


def unhindered_wait_s(process: subprocess.Popen[bytes], deadline_s: float) -> float:
    """Wait for a process to end; return the seconds that took, less those it was kept waiting.

    Raises subprocess.TimeoutExpired after `deadline_s`.
    """
    begun_s = time.monotonic()
    with kept_waiting(process.pid) as kept:
        process.wait(deadline_s)
    return time.monotonic() - begun_s - kept.seconds


def _waits_ns(pid: int) -> dict[Path, int]:
    """Return for how long each thread of a process was ready and did not run."""
    found: dict[Path, int] = {}
    with contextlib.suppress(OSError):  # Listing them fails once the process is gone.
        for thread in Path(f"/proc/{pid}/task").iterdir():
            with contextlib.suppress(OSError, IndexError):
                found[thread] = int((thread / "schedstat").read_text().split()[1])
    return found


def _stolen_s() -> float:
    """Return the time that a hypervisor took, of all processors together."""
    with contextlib.suppress(OSError, IndexError):
        words = Path("/proc/stat").read_text(encoding="ascii").split("\n", 1)[0].split()
        return int(words[8]) / os.sysconf("SC_CLK_TCK")
    return 0.0
