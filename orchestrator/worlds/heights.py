"""Elevation models for a map that was opened."""

from __future__ import annotations

from pathlib import Path

from foretwin.orchestrator.worlds.opening import OpenMap
from foretwin.world_gen.elevation.dem import DemSet


def heights_for(opened: OpenMap, dem: Path | None) -> DemSet | None:
    """Read an elevation model where one is named; raises UserError where it does not fit the map.

    Of a folder of tiles those that lie elsewhere are not kept.
    """
    if dem is None:
        return None
    # Imported here: most Worlds are flat.
    from foretwin.world_gen.elevation.read_dem import read_dem

    return read_dem(dem, around=opened.osm.bounds)
