"""A run's Worlds by their ids, as the orchestrator leaves them for the workers."""

from __future__ import annotations

from pathlib import Path

from foretwin.contracts.codec import read_message
from foretwin.contracts.world import World


def load_world(worlds_dir: Path, world_id: str) -> World:
    """Read a World's file; raises FileNotFoundError or SchemaMismatch naming the file."""
    if not world_id or "/" in world_id or "\\" in world_id or world_id.startswith("."):
        raise FileNotFoundError(f"world id {world_id!r} names no file in {worlds_dir}")
    return read_message(worlds_dir / f"{world_id}.world", World)
