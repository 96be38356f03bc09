"""A disk that is full when a test says so."""

from __future__ import annotations

import errno
import io
from pathlib import Path

from foretwin.telemetry.logs.write_mcap import DriveWriter
from tests.telemetry.drive_messages import INFO


class Disk:
    """A disk of `room` bytes, and files on it: like FileIO, they take what still fits."""

    def __init__(self, room: int | None) -> None:
        self.room = room
        self.now_s = 0.0

    def open_part(self, path: Path, *, part: int) -> DriveWriter:
        path.touch()
        raw = _FileOn(self, path)
        try:
            return DriveWriter(raw, info=INFO, part=part)  # type: ignore[arg-type]
        except OSError:
            raw.close()  # else it writes its copy whenever it is collected, over a later file
            raise

    def clock(self) -> float:
        return self.now_s


class _FileOn(io.BytesIO):
    def __init__(self, disk: Disk, copy: Path) -> None:
        super().__init__()
        self._disk, self._copy, self._end = disk, copy, 0

    def write(self, data: object) -> int:
        part = bytes(data)[: self._disk.room]  # type: ignore[call-overload]
        if not part:
            raise OSError(errno.ENOSPC, "No space left on device")
        if self._disk.room is not None:
            self._disk.room -= len(part)
        self._end += len(part)
        return super().write(part)

    def truncate(self, size: int | None = None) -> int:
        kept = super().truncate(size)
        if self._disk.room is not None:
            self._disk.room += self._end - kept
        self._end = kept
        return kept

    def close(self) -> None:
        if not self.closed:
            self._copy.write_bytes(self.getvalue())
        super().close()
