"""What a planner is made of: its distribution, its version, and a hash of its files.

An editable planner changes without its version; whoever keeps results keeps this with them.
"""

from __future__ import annotations

import hashlib
import importlib.util
from collections.abc import Iterator
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import NamedTuple


class PlannerOrigin(NamedTuple):
    """Where a planner comes from; two that are equal plan alike."""

    distribution: str
    """"" where no installed distribution offers it."""
    version: str
    files_sha256: str
    """Of every file of its package, bytecode and hidden files left out."""


def origin_of(point: EntryPoint) -> PlannerOrigin:
    """Return what the planner of an entry point is made of; imports none of it."""
    top_level = point.module.partition(".")[0]
    spec = importlib.util.find_spec(top_level)
    places = [] if spec is None else list(spec.submodule_search_locations or ())
    if spec is not None and not places and spec.has_location and spec.origin:
        places = [spec.origin]
    distribution = point.dist
    return PlannerOrigin(
        "" if distribution is None else distribution.name,
        "" if distribution is None else distribution.version,
        files_digest([Path(place) for place in places]),
    )


def files_digest(places: list[Path]) -> str:
    """Return a hash of files, and of all that lies in folders, by their names and contents."""
    whole = hashlib.sha256()
    for place in places:
        for file in [place] if place.is_file() else sorted(_files(place)):
            whole.update(str(file.relative_to(place.parent)).encode() + b"\0")
            whole.update(hashlib.sha256(file.read_bytes()).digest())
    return whole.hexdigest()


def _files(folder: Path) -> Iterator[Path]:
    for path in folder.rglob("*"):
        parts = path.relative_to(folder).parts
        if "__pycache__" in parts or any(part.startswith(".") for part in parts):
            continue
        if path.is_file():
            yield path
