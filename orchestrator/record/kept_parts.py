"""Bounds a run's folder while it goes on: the oldest parts go first, and what went is counted.

Parts are those of recordings (`drive.mcap`, `monitor.rrd`) and of tables of results; what is still
written stays, and so does all that the rest needs to be understood.
"""

from __future__ import annotations

import contextlib
import logging
import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from foretwin.contracts.segments import DRIVE_FILE, MONITOR_FILE, segments_of
from foretwin.orchestrator.keep import Keep
from foretwin.orchestrator.record.durable import whole_file
from foretwin.orchestrator.record.table_parts import table_of

log = logging.getLogger("orchestrator")

RECORDINGS = (DRIVE_FILE, MONITOR_FILE)
REMOVED = "removed.json"
"""What went so far: outlives an orchestrator."""


class _EndedPart(NamedTuple):
    path: Path
    ended_s: float
    """By UTC."""
    size_bytes: int
    of: str


class Gone(msgspec.Struct):
    """What of one recording or table went."""

    parts: int = 0
    size_bytes: int = 0
    until: str = ""
    """When the last of them ended, UTC."""


class KeptParts:
    """Looks after one run's folder."""

    def __init__(self, folder: Path, keep: Keep, *, utc_s: Callable[[], float] = time.time) -> None:
        self._folder, self._keep, self._utc_s = folder, keep, utc_s
        self.gone = read_removed(folder)

    def look(self) -> None:
        """Remove the oldest parts that are too many; raises OSError."""
        if not self._keep.bounded:
            return
        parts = sorted(self._parts(), key=lambda part: (part.ended_s, part.path.name))
        total = sum(_size(file) for file in self._folder.rglob("*"))
        for part in parts:
            too_old = self._utc_s() - part.ended_s > 3600.0 * self._keep.hours
            if not too_old and total <= self._keep.total_bytes:
                return
            part.path.unlink()
            total -= part.size_bytes
            self._count(part)

    def _parts(self) -> list[_EndedPart]:
        """Return the parts that may go: of each recording and table all that are ended."""
        found = [
            (path, name) for name in RECORDINGS for path in segments_of(self._folder / name)[:-1]
        ]
        found += [
            (path, f"{table}.parquet")
            for path in (self._folder / "results").glob("*.parquet")
            if (table := table_of(path)) is not None
        ]
        stats = [(path, path.stat(), of) for path, of in found]
        return [_EndedPart(path, stat.st_mtime, stat.st_size, of) for path, stat, of in stats]

    def _count(self, part: _EndedPart) -> None:
        gone = self.gone.setdefault(part.of, Gone())
        gone.parts += 1
        gone.size_bytes += part.size_bytes
        ended = time.gmtime(math.floor(part.ended_s))
        gone.until = time.strftime("%Y-%m-%dT%H:%M:%SZ", ended)
        log.info("%s is removed: more than is kept", part.path.name)
        with whole_file(self._folder / REMOVED) as partial:
            partial.write_bytes(msgspec.json.encode(self.gone))


def read_removed(folder: Path) -> dict[str, Gone]:
    """Return what of a run went, by recording and table; nothing where that cannot be read."""
    with contextlib.suppress(OSError, msgspec.DecodeError):
        return msgspec.json.decode((folder / REMOVED).read_bytes(), type=dict[str, Gone])
    return {}


def kept_record(folder: Path, keep: str | None) -> dict[str, Any]:
    """Return the `kept` of run.json."""
    return {"bound": keep, "removed": msgspec.to_builtins(read_removed(folder))}


def _size(file: Path) -> int:
    with contextlib.suppress(OSError):
        if file.is_file():
            return file.stat().st_size
    return 0
