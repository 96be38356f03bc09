"""Where the scenarios of a sweep take place, kept World by World: none is found out twice."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from foretwin.contracts.codec import SchemaMismatch, read_message, write_message
from foretwin.contracts.placement import WorldPlaces

PLACES = "places"
"""The folder of a sweep that holds them, a file for each World."""
_SUFFIX = ".places"


@dataclass(frozen=True)
class PlacedWorlds:
    """Worlds by their ids, and where scenarios take place in each: read as they are walked."""

    folder: Path
    ids: tuple[str, ...]

    def __iter__(self) -> Iterator[WorldPlaces]:
        return (read_places(self.folder, world_id) for world_id in self.ids)

    @property
    def sha256(self) -> str:
        """Return the hash of all of them: equal where all is planned alike."""
        digest = hashlib.sha256()
        for world_id in self.ids:
            digest.update(hashlib.sha256(_file(self.folder, world_id).read_bytes()).digest())
        return digest.hexdigest()


def keep_places(folder: Path, places: WorldPlaces) -> None:
    """Write the places of a World, whole or not at all; raises OSError."""
    folder.mkdir(exist_ok=True)
    write_message(places, _file(folder, places.world_id))


def read_places(folder: Path, world_id: str) -> WorldPlaces:
    """Return the places of a World; raises FileNotFoundError or SchemaMismatch."""
    return read_message(_file(folder, world_id), WorldPlaces)


def are_kept(folder: Path, world_id: str) -> bool:
    """Return whether the places of a World are there and whole."""
    try:
        return read_places(folder, world_id).world_id == world_id
    except (FileNotFoundError, SchemaMismatch):
        return False


def _file(folder: Path, world_id: str) -> Path:
    return folder / f"{world_id}{_SUFFIX}"
