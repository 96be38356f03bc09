"""What processor time each process of a run takes: it says so itself, in a file beside its setup.

What it started counts with it, but for who starts those that say so themselves. A process that is
killed has said so some seconds before; one that was started again has several.
"""

from __future__ import annotations

import contextlib
import os
import time
from pathlib import Path

import msgspec

_SUFFIX = ".cpu"
_EVERY_S = 2.0


class _Life(msgspec.Struct, frozen=True, kw_only=True):
    """What one process had taken when it last said so: processor and wall seconds."""

    cpu_s: float
    starting_cpu_s: float
    ready_s: float
    """For how long it could take work."""


class CpuUse(msgspec.Struct, frozen=True, kw_only=True):
    """What the lives of one process of a run took together."""

    cpu_s: float
    """Processor seconds of all its threads, its start included."""
    starting_cpu_s: float
    """Of these, until it could take work."""
    share_of_core: float | None
    """Of one processor while it could take work; None where it never could."""
    lives: int


def cpu_taken_s() -> float:
    """Return the processor seconds of this process and of those that it has started, so far."""
    times = os.times()
    ended_s = times.children_user + times.children_system
    return time.process_time() + ended_s + sum(map(_taken_s, _children()))


def _children() -> set[int]:
    """Return who runs, started by this process; nobody where the system does not tell."""
    found: set[int] = set()
    for file in Path("/proc/self/task").glob("*/children"):
        with contextlib.suppress(OSError):
            found.update(map(int, file.read_text().split()))
    return found


def _taken_s(pid: int) -> float:
    with contextlib.suppress(OSError):
        words = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
        return (int(words[11]) + int(words[12])) / os.sysconf("SC_CLK_TCK")
    return 0.0


class CpuMeter:
    """Writes what this process has taken into `folder`, now and then and at its end.

    `alone` leaves out what it started: for the one who starts processes with meters of their own.
    """

    def __init__(self, folder: Path, process_id: str, *, alone: bool = False) -> None:
        self._alone = alone
        self._file = folder / f"{process_id}-{os.getpid()}{_SUFFIX}"
        self._starting_cpu_s: float | None = None
        self._ready_s = 0.0
        self._next_s = time.monotonic() + _EVERY_S

    def ready(self) -> None:
        """The start is over: the process can take work."""
        self._starting_cpu_s, self._ready_s = self._taken_s(), time.monotonic()

    def look(self) -> None:
        """Write where it is time to; call it often."""
        if time.monotonic() >= self._next_s:
            self.write()

    def write(self) -> None:
        """Write what was taken until now; a disk that is full must not end a process."""
        now_s, cpu_s = time.monotonic(), self._taken_s()
        self._next_s = now_s + _EVERY_S
        starting_cpu_s = self._starting_cpu_s
        life = _Life(
            cpu_s=cpu_s,
            starting_cpu_s=cpu_s if starting_cpu_s is None else starting_cpu_s,
            ready_s=0.0 if starting_cpu_s is None else now_s - self._ready_s,
        )
        with contextlib.suppress(OSError):
            # One write of the same length each time: who reads meanwhile sees no half of it.
            self._file.write_bytes(msgspec.json.encode(life).ljust(160) + b"\n")

    def _taken_s(self) -> float:
        return time.process_time() if self._alone else cpu_taken_s()


def cpu_uses(folder: Path) -> dict[str, CpuUse]:
    """Return what each process of a run has taken, by its id, the most first."""
    lives: dict[str, list[_Life]] = {}
    for file in folder.glob(f"*{_SUFFIX}"):
        with contextlib.suppress(OSError, msgspec.DecodeError):
            life = msgspec.json.decode(file.read_bytes(), type=_Life)
            lives.setdefault(file.stem.rsplit("-", 1)[0], []).append(life)
    found = {process_id: _together(each) for process_id, each in lives.items()}
    return dict(sorted(found.items(), key=lambda item: (-item[1].cpu_s, item[0])))


def _together(lives: list[_Life]) -> CpuUse:
    cpu_s, starting_cpu_s = (
        sum(getattr(one, name) for one in lives) for name in ("cpu_s", "starting_cpu_s")
    )
    ready_s = sum(one.ready_s for one in lives)
    return CpuUse(
        cpu_s=round(cpu_s, 2),
        starting_cpu_s=round(starting_cpu_s, 2),
        share_of_core=round((cpu_s - starting_cpu_s) / ready_s, 4) if ready_s else None,
        lives=len(lives),
    )
