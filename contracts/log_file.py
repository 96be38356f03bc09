"""The log of a run: one file that all its processes append to, a JSON object on each line."""

from __future__ import annotations

import contextlib
import json
import logging
import os
from pathlib import Path


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
    fork of this process or at its end. After the beginning of a line a new one is begun.
    """

    def __init__(self, file: Path) -> None:
        super().__init__()
        self._file = file
        self._descriptor: int | None = None
        self._torn = False

    def emit(self, record: logging.LogRecord) -> None:
        """Append one record; never raises."""
        try:
            line = (self.format(record) + "\n").encode(errors="backslashreplace")
        except Exception:
            self.handleError(record)
            return
        with contextlib.suppress(OSError):
            if self._descriptor is None:
                flags = os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_CLOEXEC
                self._descriptor = os.open(self._file, flags, 0o644)
            data = b"\n" * self._torn + line
            self._torn = os.write(self._descriptor, data) < len(data)

    def close(self) -> None:
        """Close the file."""
        with self.lock or contextlib.nullcontext():
            if self._descriptor is not None:
                os.close(self._descriptor)
                self._descriptor = None
        super().close()
