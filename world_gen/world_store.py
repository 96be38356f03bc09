"""Worlds on disk: by id, and by what they were built from."""

from __future__ import annotations

import hashlib
import json
import os
from pathlib import Path
from typing import NamedTuple

from foretwin.contracts.codec import SchemaMismatch, read_message, write_message
from foretwin.contracts.world import World
from foretwin.world_gen.build import DEFAULT_RADIUS_M, GENERATOR_VERSION, build_world
from foretwin.world_gen.junctions.intersections import Junction
from foretwin.world_gen.junctions.map_index import MapIndex


class CachedWorld(NamedTuple):
    """A World and whether it came from the cache."""

    world: World
    cached: bool


class WorldStore:
    """A folder of `<id>.world` files; several processes may share it."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        folder.mkdir(parents=True, exist_ok=True)

    def path_of(self, world_id: str) -> Path:
        """Return where the World of this id is, or would be."""
        return self.folder / f"{world_id}.world"

    def save(self, world: World) -> Path:
        """Write a World, complete or not at all, and return its path."""
        path = self.path_of(world.id)
        # Another process may be writing the same World: each has a name of its own for it.
        mine = path.with_name(f"{world.id}.{os.getpid()}.part")
        write_message(world, mine)
        mine.replace(path)
        return path

    def load(self, world_id: str) -> World:
        """Read a World; FileNotFoundError where the folder has none of this id."""
        path = self.path_of(world_id)
        if not path.exists():
            raise FileNotFoundError(f"{self.folder} holds no world {world_id!r}")
        return read_message(path, World)

    def find(self, map_key: str, intersection_id: str, radius_m: float) -> World | None:
        """Return the World built from this map, junction and radius by this generator, if kept.

        `map_key` is that of the `MapIndex`.
        """
        entry = self._entry(map_key, intersection_id, radius_m)
        try:
            return self.load(entry.read_text(encoding="ascii").strip())
        except (FileNotFoundError, SchemaMismatch):
            return None

    def remember(self, world: World, map_key: str) -> None:
        """Save a World and enter it under what it was built from."""
        self.save(world)
        entry = self._entry(map_key, world.intersection.id, world.radius_m)
        partial = entry.with_name(f"{entry.stem}.{os.getpid()}.part")
        partial.write_text(world.id, encoding="ascii")
        partial.replace(entry)

    def _entry(self, map_key: str, intersection_id: str, radius_m: float) -> Path:
        key = json.dumps([map_key, intersection_id, float(radius_m), GENERATOR_VERSION])
        return self.folder / f"{hashlib.sha256(key.encode()).hexdigest()[:32]}.key"


def cached_build(
    store: WorldStore, index: MapIndex, junction: Junction, *, radius_m: float = DEFAULT_RADIUS_M
) -> CachedWorld:
    """Return the World of a junction, from the store where it is there, else built and kept."""
    known = store.find(index.map_key, junction.summary.id, radius_m)
    if known is not None:
        return CachedWorld(known, True)
    world = build_world(index.osm, index.graph, junction, radius_m=radius_m, index=index)
    store.remember(world, index.map_key)
    return CachedWorld(world, False)
