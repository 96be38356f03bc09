"""What stands in the log of a run, for tests that look."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, NamedTuple


class LogLines(NamedTuple):
    """The lines of a log that are whole, and how many are not."""

    lines: list[dict[str, Any]]
    torn: int


def read_log(file: Path) -> LogLines:
    """Return what a log holds; a line that was cut short costs itself alone. Raises OSError."""
    lines, torn = [], 0
    for line in file.read_bytes().splitlines(keepends=True):
        try:
            found = json.loads(line)
        except ValueError:
            found = None
        if isinstance(found, dict) and line.endswith(b"\n"):
            lines.append(found)
        else:
            torn += bool(line.strip())
    return LogLines(lines, torn)
