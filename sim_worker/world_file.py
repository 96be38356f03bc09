"""Where a worker gets the Worlds of its jobs from, by their ids."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple, Protocol

from foretwin.contracts.codec import read_message
from foretwin.contracts.world import World


class WorldSource(Protocol):
    """Has Worlds by their ids: a folder, or whatever brings them to this machine."""

    def world(self, world_id: str) -> World:
        """Return a World; raises OSError where it is not there, SchemaMismatch where what is there
        is not it, each naming where."""


class WorldFolder(NamedTuple):
    """The folder in which the orchestrator leaves the Worlds of a run."""

    folder: Path

    def world(self, world_id: str) -> World:
        """Read a World's file; see WorldSource."""
        return load_world(self.folder, world_id)


def load_world(worlds_dir: Path, world_id: str) -> World:
    """Read a World's file; raises FileNotFoundError or SchemaMismatch naming the file."""
    if not world_id or "/" in world_id or "\\" in world_id or world_id.startswith("."):
        raise FileNotFoundError(f"world id {world_id!r} names no file in {worlds_dir}")
    return read_message(worlds_dir / f"{world_id}.world", World)
