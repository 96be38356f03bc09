"""Files of one recording in parts: `drive.mcap`, then `drive-002.mcap`, `drive-003.mcap`.

A recording that fits into one file has the name that everybody knows. Of one whose folder is
bounded the oldest parts are gone, the first among them.
"""

from __future__ import annotations

import re
from pathlib import Path

import msgspec

DRIVE_FILE, MONITOR_FILE = "drive.mcap", "monitor.rrd"
"""First parts of what a run's car sent, and of what its viewer showed."""


class Roll(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """When a part of a recording is ended, and the next one begun."""

    most_bytes: int = 64 * 2**20
    """An hour of a car; some seconds to read where it was cut short."""
    most_s: float = 3600.0

    def is_due(self, *, size_bytes: int, age_s: float) -> bool:
        """Whether a part of this size and age is enough."""
        return size_bytes >= self.most_bytes or age_s >= self.most_s


def segment_file(first: Path, number: int) -> Path:
    """Return the name of a part; the first, number 1, is `first` itself."""
    return first if number == 1 else first.with_name(f"{first.stem}-{number:03d}{first.suffix}")


def number_of(first: Path, path: Path) -> int | None:
    """Return which part of `first` a file is by its name, None where it is none."""
    if path.name == first.name:
        return 1
    named = re.fullmatch(rf"{re.escape(first.stem)}-(\d{{3,}}){re.escape(first.suffix)}", path.name)
    if named is None or segment_file(first, number := int(named[1])).name != path.name:
        return None
    return number


def segments_of(first: Path) -> list[Path]:
    """Return the parts that are there, in their order."""
    if not first.parent.is_dir():
        return []
    numbered = {path: number_of(first, path) for path in first.parent.iterdir()}
    parts = {path: number for path, number in numbered.items() if number is not None}
    return sorted(parts, key=lambda path: parts[path])


def first_name(path: Path) -> Path:
    """Return the name of the first part of the recording that a file is a part of by its name."""
    named = re.fullmatch(r"(.+)-\d{3,}", path.stem)
    first = path if named is None else path.with_name(f"{named[1]}{path.suffix}")
    return first if number_of(first, path) is not None else path


def first_left(first: Path) -> Path:
    """Return the oldest part that is there; the first itself where there is none."""
    return next(iter(segments_of(first)), first)


def next_number(first: Path) -> int:
    """Return the number after the last part that is there."""
    parts = segments_of(first)
    return 1 if not parts else (number_of(first, parts[-1]) or 0) + 1
