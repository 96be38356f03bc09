"""How many refusals of each kind, bounded, and where a process leaves its own for run.json.

A process that is killed has said so a moment before; one that was started again has several files.
"""

from __future__ import annotations

import contextlib
import math
import os
import time
from collections import Counter
from pathlib import Path

import msgspec

from foretwin.contracts.partial_file import partial_file

MOST_KINDS = 200
"""Of sender, reason and key together: who makes up new ones fills no memory; the rest is one."""
MOST_KEYS = 8
"""Of one sender and reason; the rest is one."""
REST = "others"
_MOST_TEXT = 200
_SUFFIX = ".refused"
_EVERY_S = 1.0


class RefusedKind(msgspec.Struct, frozen=True, kw_only=True):
    """Refusals of one kind: whom, why, and, where that says more, on which key."""

    sender: str
    reason: str
    key: str = ""
    count: int


class OwnRefusals(msgspec.Struct, frozen=True, kw_only=True):
    """What one process of a run has refused so far."""

    kinds: tuple[RefusedKind, ...] = ()
    counted_all: bool = True
    """Whether nothing came faster than it can be counted."""

    @property
    def count(self) -> int:
        """How many, of all kinds."""
        return sum(kind.count for kind in self.kinds)


class RefusalCounts:
    """Counts refusals by sender, reason and key."""

    def __init__(self) -> None:
        self._counts: Counter[tuple[str, str, str]] = Counter()
        self._keys: Counter[tuple[str, str]] = Counter()
        """How many keys are known of a sender and reason."""

    def __len__(self) -> int:
        return self._counts.total()

    def add(self, sender: str, reason: str, *, key: str = "", count: int = 1) -> bool:
        """Count; returns whether they are the first of their sender and reason."""
        sender, reason, key = sender[:_MOST_TEXT], reason[:_MOST_TEXT], key[:_MOST_TEXT]
        if (sender, reason) not in self._keys and len(self._counts) >= MOST_KINDS:
            sender, reason, key = REST, "various", ""
        whose = sender, reason
        if (*whose, key) not in self._counts:
            full = len(self._counts) >= MOST_KINDS or self._keys[whose] >= MOST_KEYS
            key = REST if full and whose in self._keys else key
        first = whose not in self._keys
        if (*whose, key) not in self._counts:
            self._keys[whose] += 1
        self._counts[(*whose, key)] += count
        return first

    def knows(self, sender: str, reason: str) -> bool:
        """Whether any was counted of a sender and reason."""
        return (sender, reason) in self._keys

    def kinds(self) -> tuple[RefusedKind, ...]:
        """Return all of them, in order."""
        return tuple(
            RefusedKind(sender=sender, reason=reason, key=key, count=count)
            for (sender, reason, key), count in sorted(self._counts.items())
        )


class RefusalFile:
    """Where this process says what it has refused; `write` does nothing where that is not new."""

    def __init__(self, folder: Path, process_id: str) -> None:
        self._file = folder / f"{process_id}-{os.getpid()}{_SUFFIX}"
        self._written = OwnRefusals()
        self._next_s = -math.inf

    def look(self, counts: RefusalCounts) -> None:
        """Write what was counted, where it is time to; call it often."""
        now_s = time.monotonic()
        if len(counts) != self._written.count and now_s >= self._next_s:
            self._next_s = now_s + _EVERY_S
            self.write(OwnRefusals(kinds=counts.kinds()))

    def write(self, now: OwnRefusals) -> None:
        """Say it; who reads meanwhile sees all of it, and a full disk ends no process."""
        if now == self._written:
            return
        with contextlib.suppress(OSError):
            with partial_file(self._file) as partial:
                partial.write_bytes(msgspec.json.encode(now))
            self._written = now


def refused_by(folder: Path) -> dict[str, OwnRefusals]:
    """Return what each process of a run has refused in all its lives, by its id."""
    lives: dict[str, list[OwnRefusals]] = {}
    for file in sorted(folder.glob(f"*{_SUFFIX}")):
        with contextlib.suppress(OSError, msgspec.DecodeError):
            life = msgspec.json.decode(file.read_bytes(), type=OwnRefusals)
            lives.setdefault(file.stem.rsplit("-", 1)[0], []).append(life)
    return {process_id: _together(each) for process_id, each in lives.items()}


def _together(lives: list[OwnRefusals]) -> OwnRefusals:
    counts = RefusalCounts()
    for kind in (kind for life in lives for kind in life.kinds):
        counts.add(kind.sender, kind.reason, key=kind.key, count=kind.count)
    return OwnRefusals(kinds=counts.kinds(), counted_all=all(life.counted_all for life in lives))
