"""Worlds that come over the bus by the hash of their content, and a cache of them on this disk."""

from __future__ import annotations

import contextlib
import logging
import os
from collections.abc import Callable
from pathlib import Path

from foretwin.contracts.bus import Bus, ask
from foretwin.contracts.codec import SchemaMismatch
from foretwin.contracts.fleet import WorldBytes, WorldQuestion
from foretwin.contracts.partial_file import partial_file
from foretwin.contracts.world import World
from foretwin.contracts.world_identity import checked_world

log = logging.getLogger("sim_worker")

FETCH_S = 30.0
"""A World of a megabyte takes so long over a link of 300 kbit/s."""
MOST_KEPT = 500
"""Worlds on the disk, of 0.1 to 2 MB each; those used last stay."""
SUFFIX = ".world"


class CachedWorlds:
    """The Worlds of a drive on another machine; see WorldSource. Several processes may share it.

    What the cache holds is checked by its hash as is what comes: damaged bytes are used by nobody.
    Where the disk takes none, a World is fetched each time, and `trouble` is told once.
    """

    def __init__(self, folder: Path, bus: Bus, *, run: str, trouble: Callable[[str], None]) -> None:
        self._folder, self._bus, self._run = folder, bus, run
        self._trouble = trouble
        self._told = False

    def world(self, world_id: str) -> World:
        """Return a World from the disk, else from the drive; see WorldSource."""
        file = self._folder / f"{world_id}{SUFFIX}"
        with contextlib.suppress(FileNotFoundError):
            try:
                world = checked_world(file.read_bytes(), world_id, where=str(file))
                os.utime(file)
                return world
            except SchemaMismatch as damaged:
                log.warning("%s; fetched again", damaged)
                file.unlink(missing_ok=True)
        return self._fetched(world_id, file)

    def _fetched(self, world_id: str, file: Path) -> World:
        question = WorldQuestion(world_id=world_id)
        answer = ask(self._bus, "world_file", question, timeout_s=FETCH_S, run=self._run)
        assert isinstance(answer, WorldBytes)
        where = f"what the drive sent as World {world_id}"
        world = checked_world(answer.data, world_id, where=where)
        log.info("World %s: %d bytes over the bus", world_id, len(answer.data))
        self._keep(answer.data, file)
        return world

    def _keep(self, data: bytes, file: Path) -> None:
        try:
            # Another process of this machine may be writing the same World.
            with partial_file(file, ending=f".{os.getpid()}.partial") as partial:
                partial.write_bytes(data)
            kept = sorted(self._folder.glob(f"*{SUFFIX}"), key=lambda one: one.stat().st_mtime_ns)
            for old in kept[:-MOST_KEPT]:
                old.unlink(missing_ok=True)
        except OSError as error:
            if not self._told:
                self._told = True
                why = (error.strerror or str(error)).lower()
                self._trouble(f"{self._folder}: {why}; Worlds are fetched again each time")
