"""The memory of a drive's processes: watched while it goes on, told where one grows, recorded.

What counts is a process's own memory: resident, in no file, and without what it shared with others
as it was first looked at: a fork has all that its supervisor had.
"""

from __future__ import annotations

import contextlib
import math
import os
from collections import deque
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from foretwin.contracts.running import RunningMeans

LOOK_EVERY_S = 5.0
SETTLED_AFTER_S = 300.0
"""What a process grows by later it may grow by for ever."""
FLOOR_S = 60.0
"""What a process holds for a moment, and gives back within a minute, is no growth."""
GROWN_MB, MOST_MB = 256.0, 4096.0
"""Who has grown by so much since it settled, or is so large, is told of; again at each doubling."""
_LEAST_SPAN_S = 600.0
_PAGE_BYTES = os.sysconf("SC_PAGE_SIZE")


@dataclass(slots=True)
class _Watched:
    pid: int
    since_s: float
    shared_mb: float
    """Of what lies in no file, what others had too at first. It is not asked again: that takes ten
    milliseconds a process, a hundred times as long as how much there is."""
    now_mb: float = 0.0
    most_mb: float = 0.0
    settled: tuple[float, float] | None = None
    """When it had run for long enough, and the least that it held in the minute before."""
    last_s: float = 0.0
    _recent: deque[tuple[float, float]] = field(default_factory=deque)
    _floors: RunningMeans = field(default_factory=RunningMeans)
    """Of hours since it settled, the floor in MB, and products of these, each minute."""
    _next_floor_s: float = -math.inf
    tell_at_mb: float = MOST_MB

    def take(self, now_s: float, now_mb: float) -> bool:
        """Take what it holds now; returns whether that is to be told."""
        self.last_s, self.now_mb = now_s, now_mb
        self.most_mb = max(self.most_mb, now_mb)
        self._recent.append((now_s, now_mb))
        while self._recent[0][0] <= now_s - FLOOR_S:
            self._recent.popleft()
        if self.settled is None and now_s - self.since_s >= SETTLED_AFTER_S:
            self.settled = now_s, self.floor_mb
            self.tell_at_mb = min(self.tell_at_mb, self.floor_mb + GROWN_MB)
        if self.settled is not None and now_s >= self._next_floor_s:
            self._next_floor_s = now_s + FLOOR_S
            hours, floor_mb = (now_s - self.settled[0]) / 3600.0, self.floor_mb
            self._floors.take((hours, floor_mb, hours * hours, hours * floor_mb))
        if now_mb < self.tell_at_mb:
            return False
        self.tell_at_mb = 2.0 * now_mb
        return True

    @property
    def floor_mb(self) -> float:
        """The least that it held within the last minute."""
        return min(mb for _, mb in self._recent)

    @property
    def mb_per_h(self) -> float | None:
        """How fast its floor has grown since it settled, None before that can be told.

        It is the slope of a line through the floors of all minutes, as what a process does differs
        between any two of them.
        """
        if self.settled is None or self.last_s - self.settled[0] < _LEAST_SPAN_S:
            return None
        hours, floor_mb, square, product = self._floors.means
        return (product - hours * floor_mb) / (square - hours * hours)


@dataclass(slots=True)
class MemoryWatch:
    """Looks into /proc; where there is none, nothing is known. Times are monotonic, in s."""

    proc: Path = Path("/proc")
    _watched: dict[str, _Watched] = field(default_factory=dict)
    _looked_s: float | None = None

    def look(
        self, running: Mapping[str, int], now_s: float, *, own: str = "orchestrator"
    ) -> list[str]:
        """Look again, at most every few seconds; returns what is to be told.

        `running` are the processes by name; `own` is this one. Each call takes in one that is new:
        what it shares takes long to tell, and whose loop this is cannot stand still for all.
        """
        here = {own: os.getpid(), **running}
        names = self._met(here, now_s)
        if self._looked_s is None or now_s - self._looked_s >= LOOK_EVERY_S:
            self._looked_s = now_s
            names = [name for name, one in self._watched.items() if here.get(name) == one.pid]
        return [text for name in names for text in self._told(name, now_s)]

    @property
    def now_mb(self) -> dict[str, float]:
        """What each process holds."""
        return {name: one.now_mb for name, one in self._watched.items()}

    def record(self) -> dict[str, Any]:
        """Return the `memory` of run.json, in MB."""
        return {
            name: {
                "at_end": round(one.now_mb, 1),
                "most": round(one.most_mb, 1),
                "settled": None if one.settled is None else round(one.settled[1], 1),
                "per_hour": None if one.mb_per_h is None else round(one.mb_per_h, 1),
            }
            for name, one in sorted(self._watched.items())
        }

    def _met(self, here: Mapping[str, int], now_s: float) -> list[str]:
        """Take in one process that is new, and return its name."""
        for name, pid in here.items():
            known = self._watched.get(name)
            held_mb = None if known is not None and known.pid == pid else self._held_mb(pid)
            if held_mb is not None:
                shared_mb = max(held_mb - self._alone_mb(pid), 0.0)
                most_mb = 0.0 if known is None else known.most_mb
                self._watched[name] = _Watched(pid, now_s, shared_mb, most_mb=most_mb)
                return [name]
        return []

    def _told(self, name: str, now_s: float) -> Iterator[str]:
        one = self._watched[name]
        held_mb = self._held_mb(one.pid)
        if held_mb is None:
            return
        now_mb = max(held_mb - one.shared_mb, 0.0)
        if one.take(now_s, now_mb):
            yield f"{name} holds {now_mb:.0f} MB of memory{_since(one)}"

    def _held_mb(self, pid: int) -> float | None:
        """Return what a process holds in memory that lies in no file."""
        with contextlib.suppress(OSError, ValueError, IndexError):
            pages = (self.proc / str(pid) / "statm").read_text().split()
            return (int(pages[1]) - int(pages[2])) * _PAGE_BYTES / 1e6
        return None

    def _alone_mb(self, pid: int) -> float:
        """Return how much was written to and is shared with no other; all where that is not told.

        By proc_pid_smaps(5), whose "kB" are of 1024 bytes.
        """
        with contextlib.suppress(OSError, ValueError, IndexError):
            told = (self.proc / str(pid) / "smaps_rollup").read_text()
            return int(told.split("Private_Dirty:")[1].split()[0]) * 1024 / 1e6
        return math.inf


def _since(one: _Watched) -> str:
    if one.settled is None:
        return ""
    grown_mb, minutes = one.now_mb - one.settled[1], SETTLED_AFTER_S / 60.0
    return f", {grown_mb:.0f} MB more than {minutes:g} min after its start"
