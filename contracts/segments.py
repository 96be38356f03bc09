"""Files of one recording in parts: `drive.mcap`, then `drive-002.mcap`, `drive-003.mcap`.

A recording that fits into one file has the name that everybody knows.
"""

from __future__ import annotations

import re
from pathlib import Path


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


def next_number(first: Path) -> int:
    """Return the number after the last part that is there."""
    parts = segments_of(first)
    return 1 if not parts else (number_of(first, parts[-1]) or 0) + 1
