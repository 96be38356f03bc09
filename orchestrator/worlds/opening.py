"""Opens a map for a command: where a large one is indexed first, behind a progress bar."""

from __future__ import annotations

from pathlib import Path

from foretwin.world_gen import opening
from foretwin.world_gen.opening import LARGE_MAP_BYTES, Clip, NodeClip, OpenMap
from foretwin.world_gen.osm.map_store import MapStore
from foretwin.world_gen.osm.osm_map import LatLonBounds


def open_map(
    file: Path,
    *,
    clip: Clip | NodeClip | LatLonBounds | None = None,
    service_roads: bool = False,
    tides: bool = True,
    large_bytes: int = LARGE_MAP_BYTES,
) -> OpenMap:
    """Read a map; see `foretwin.world_gen.opening`."""
    return opening.open_map(
        file,
        clip=clip,
        service_roads=service_roads,
        tides=tides,
        large_bytes=large_bytes,
        open_index=_behind_a_bar,
    )


def _behind_a_bar(file: Path) -> MapStore:
    # Imported here: most maps are small, and commands on them are to start fast.
    from foretwin.orchestrator.worlds.indexing import open_index

    return open_index(file, None)
