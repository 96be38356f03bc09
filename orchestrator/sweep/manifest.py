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

MANIFEST = "manifest.jsonl"
_NOWHERE = -1


class PartEntry(msgspec.Struct, frozen=True, kw_only=True):
    """One job whose parts are there; `tables` has the SHA-256 of each of its files."""

    job: Annotated[int, msgspec.Meta(ge=0)]
    job_sha256: str
    rows: int
    rows_sha256: str
    tables: dict[str, str]
    counts: tuple[CaseCount, ...]
    given_up: int = 0


_decoder = msgspec.json.Decoder(PartEntry)


def listed_parts(folder: Path) -> tuple[PartEntry, ...]:
    """Return the last entry of each job that a folder lists, by job; raises OSError."""
    with (folder / MANIFEST).open("rb") as lines:
        found = {entry.job: entry for line in lines if (entry := _read(line)) is not None}
    return tuple(found[job] for job in sorted(found))


class Manifest:
    """Entries of the first `jobs` jobs, the last one of each counts; in memory is only where each
    of them stands.

    A line that a kill or a full disk cut short is passed by. Use it as a context.
    """

    def __init__(self, folder: Path, *, jobs: int) -> None:
        self.path = folder / MANIFEST
        self._at = array("q", [_NOWHERE]) * jobs

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

    def lists(self, job: int) -> bool:
        """Return whether there is an entry of a job."""
        return self._at[job] != _NOWHERE

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
        if not self.lists(job):
            return None
        self._lines.seek(self._at[job])
        return _read(self._lines.readline())

    def entries(self) -> Iterator[PartEntry]:
        """Yield the entries in the order of the jobs."""
        for job in range(len(self._at)):
            if (entry := self.entry(job)) is not None:
                yield entry

    def _note(self, job: int, offset: int) -> None:
        if job < len(self._at):  # else of a longer plan
            self._at[job] = offset


def _read(line: bytes) -> PartEntry | None:
    try:
        return _decoder.decode(line)
    except msgspec.DecodeError:
        return None
