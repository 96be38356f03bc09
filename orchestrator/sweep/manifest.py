"""The list of a sweep's parts that are there: append-only, read entry by entry."""

from __future__ import annotations

import errno
import os
from array import array
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Self

import msgspec

from foretwin.contracts.parts import CaseCount
from foretwin.orchestrator.sweep.plan import MOST_CELLS

MANIFEST = "manifest.jsonl"


class PartEntry(msgspec.Struct, frozen=True, kw_only=True):
    """One job whose parts are there; `tables` has the SHA-256 of each of its files."""

    job: Annotated[int, msgspec.Meta(ge=0, le=MOST_CELLS)]
    job_sha256: str
    rows: int
    rows_sha256: str
    tables: dict[str, str]
    counts: tuple[CaseCount, ...]
    given_up: int = 0


_decoder = msgspec.json.Decoder(PartEntry)


class Manifest:
    """Entries of jobs, the last one of each counts; in memory is only where each of them stands.

    A line that a kill or a full disk cut short is passed by. Use it as a context.
    """

    def __init__(self, folder: Path) -> None:
        self.path = folder / MANIFEST
        self._at = array("q")

    def __enter__(self) -> Self:
        self._file = self.path.open("a+b", buffering=0)
        offset, line = 0, b"\n"
        with self.path.open("rb") as lines:
            for line in lines:
                if (entry := _read(line)) is not None:
                    self._note(entry.job, offset)
                offset += len(line)
        if not line.endswith(b"\n"):
            self._file.write(b"\n")
        self._lines = self.path.open("rb")
        return self

    def __exit__(self, *what: object) -> None:
        self._file.close()
        self._lines.close()

    def __len__(self) -> int:
        """One more than the greatest number of a job of which there was an entry."""
        return len(self._at)

    def add(self, entry: PartEntry) -> None:
        """Write an entry at the end; raises OSError, and then there is none."""
        offset = self._file.seek(0, os.SEEK_END)
        line = msgspec.json.encode(entry) + b"\n"
        if self._file.write(line) != len(line):
            self._file.truncate(offset)
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(self.path))
        self._note(entry.job, offset)

    def entry(self, job: int) -> PartEntry | None:
        """Return the entry of a job, None where there is none."""
        if not 0 <= job < len(self._at) or self._at[job] < 0:
            return None
        self._lines.seek(self._at[job])
        return _read(self._lines.readline())

    def entries(self, jobs: int) -> Iterator[PartEntry]:
        """Yield the entries of the first so many jobs, in the order of the plan."""
        for job in range(min(jobs, len(self._at))):
            if (entry := self.entry(job)) is not None:
                yield entry

    def _note(self, job: int, offset: int) -> None:
        missing = job + 1 - len(self._at)
        if missing > 0:
            self._at.extend([-1] * missing)
        self._at[job] = offset


def _read(line: bytes) -> PartEntry | None:
    try:
        return _decoder.decode(line)
    except msgspec.DecodeError:
        return None
