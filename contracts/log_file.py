"""The log of a run: one file that all its processes append to, a JSON object on each line."""

from __future__ import annotations

import contextlib
import json
import logging
import os
from pathlib import Path

MOST_BYTES, MOST_URGENT_BYTES = 8_000_000, 16_000_000
"""Of one process in a log: a day's drive says some hundred kilobytes."""


class JsonLines(logging.Formatter):
    """One JSON object per line: wall time, process, level, text, and the traceback if any."""

    def __init__(self, process_id: str) -> None:
        super().__init__()
        self._process_id = process_id

    def format(self, record: logging.LogRecord) -> str:
        """Return the record as one line."""
        line = {
            "wall_s": round(record.created, 3),
            "process": self._process_id,
            "level": record.levelname.lower(),
            "source": record.name,
            "text": record.getMessage(),
        }
        if record.exc_info:
            line["traceback"] = self.formatException(record.exc_info)
        return json.dumps(line, ensure_ascii=False)


class LogFile(logging.Handler):
    """Appends each line in one call; lines of several processes interleave.

    What a full disk does not take is lost in silence, and only that: nothing waits for later, in a
    fork of this process or at its end. After the beginning of a line, whoever has begun it, a new
    one is begun. Of one process no more than `MOST_BYTES` are kept, of warnings and worse
    `MOST_URGENT_BYTES`: the others are counted, and how many they were is its last line.
    """

    def __init__(self, file: Path) -> None:
        super().__init__()
        self._file = file
        self._descriptor: int | None = None
        self._written = self._left_out = 0

    def emit(self, record: logging.LogRecord) -> None:
        """Append one record; never raises."""
        try:
            line = (self.format(record) + "\n").encode(errors="backslashreplace")
        except Exception:
            self.handleError(record)
            return
        most = MOST_URGENT_BYTES if record.levelno >= logging.WARNING else MOST_BYTES
        if self._written + len(line) > most:
            self._left_out += 1
        else:
            self._append(line)

    def _append(self, line: bytes) -> None:
        with contextlib.suppress(OSError):
            if self._descriptor is None:
                flags = os.O_RDWR | os.O_APPEND | os.O_CREAT | os.O_CLOEXEC
                self._descriptor = os.open(self._file, flags, 0o644)
            size = os.fstat(self._descriptor).st_size
            torn = size > 0 and os.pread(self._descriptor, 1, size - 1) != b"\n"
            self._written += os.write(self._descriptor, b"\n" * torn + line)

    def close(self) -> None:
        """Close the file."""
        with self.lock or contextlib.nullcontext():
            if self._left_out:
                text = f"{self._left_out} lines are left out: more than is kept of one process"
                self._left_out = 0
                told = logging.LogRecord("log", logging.WARNING, "", 0, text, (), None)
                self._append((self.format(told) + "\n").encode())
            if self._descriptor is not None:
                os.close(self._descriptor)
                self._descriptor = None
        super().close()
