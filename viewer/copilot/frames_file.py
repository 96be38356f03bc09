"""What the display showed, kept: lines of JSON in a file that only grows, compressed.

Each second is a frame of zstandard of its own, so that a kill takes no more along than that, and
what was written can be read while the run goes on.
"""

from __future__ import annotations

import io
from bisect import bisect_right
from pathlib import Path

import msgspec
import zstandard

from foretwin.contracts.errors import UserError
from foretwin.viewer.copilot.frame import PageFrame

WRITE_S = 1.0


class FramesWriter:
    """Appends frames; what a disk does not take is lost, and counted."""

    def __init__(self, file: Path, now_s: float) -> None:
        self._file, self._written_s = file, now_s
        self._lines: list[bytes] = []
        self.lost = 0

    def add(self, frame: bytes, now_s: float) -> None:
        """Keep a frame, one line of JSON."""
        self._lines.append(frame)
        if now_s - self._written_s >= WRITE_S:
            self.write()
            self._written_s = now_s

    def write(self) -> None:
        """Write what waits; never raises for a full disk."""
        lines, self._lines = self._lines, []
        if not lines:
            return
        data = zstandard.ZstdCompressor(level=3).compress(b"\n".join(lines) + b"\n")
        try:
            with self._file.open("ab") as out:
                out.write(data)
        except OSError:
            self.lost += len(lines)


class KeptFrames:
    """The frames of a run, by drive time; raises UserError where there are none to be read."""

    def __init__(self, file: Path) -> None:
        try:
            data = file.read_bytes()
        except OSError as error:
            raise UserError(
                f"{file}: no frames of a co-pilot display; a drive with --view copilot keeps them"
            ) from error
        self.frames = _frames(data)
        if not self.frames:
            raise UserError(f"{file}: holds no whole frame")
        self._times_s = [frame.drive_s for frame in self.frames]

    @property
    def begins_s(self) -> float:
        """Drive time of the first frame."""
        return self._times_s[0]

    @property
    def ends_s(self) -> float:
        """Drive time of the last frame."""
        return self._times_s[-1]

    def at(self, drive_s: float) -> PageFrame:
        """Return the frame that was shown at a drive time; before the first, that one."""
        return self.frames[max(0, bisect_right(self._times_s, drive_s) - 1)]


def _frames(data: bytes) -> list[PageFrame]:
    """Return the frames in order of drive time; a torn end is left out."""
    text = b""
    with zstandard.ZstdDecompressor().stream_reader(
        io.BytesIO(data), read_across_frames=True
    ) as reader:
        try:
            while part := reader.read(1 << 20):
                text += part
        except zstandard.ZstdError:
            pass
    frames = []
    for line in text.splitlines():
        try:
            frames.append(msgspec.json.decode(line, type=PageFrame))
        except msgspec.DecodeError:
            break
    return sorted(frames, key=lambda frame: frame.drive_s)
