"""Builds Worlds where a worker is: from a map that it reads once."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from foretwin.contracts.codec import encode
from foretwin.contracts.errors import UserError, one_line
from foretwin.contracts.world_building import BuiltWorld, MapPart, WantedWorld
from foretwin.world_gen.build import build_world
from foretwin.world_gen.elevation.read_dem import read_dem
from foretwin.world_gen.junctions.intersections import Junction
from foretwin.world_gen.junctions.map_index import MapIndex, index_map
from foretwin.world_gen.opening import NodeClip, open_map
from foretwin.world_gen.osm.osm_map import LatLonBounds


class _Opened(NamedTuple):
    part: MapPart
    prepared: MapIndex
    junctions: dict[str, Junction]


class WorldBuilder:
    """Builds Worlds; holds the map that it read last."""

    def __init__(self) -> None:
        self._opened: _Opened | None = None

    def build(self, wanted: WantedWorld) -> BuiltWorld:
        """Return a World as whoever has the map builds it, or why there is none; never raises."""
        try:
            opened = self._open(wanted.of)
        except FileNotFoundError as error:
            return BuiltWorld(failure=str(error), no_map=True)
        except (UserError, OSError) as error:
            return BuiltWorld(failure=str(error), of_input=True)
        try:
            junction, index = opened.junctions[wanted.junction_id], opened.prepared
            world = build_world(
                index.osm, index.graph, junction, radius_m=wanted.radius_m, index=index
            )
            return BuiltWorld(world_id=world.id, data=encode(world))
        except Exception as error:  # one bad junction never stops the rest
            return BuiltWorld(failure=one_line(error))

    def _open(self, part: MapPart) -> _Opened:
        if self._opened is not None and self._opened.part == part:
            return self._opened
        self._opened = None
        file = Path(part.map)
        if not file.is_file():
            raise FileNotFoundError(f"map {part.map}: no such file here")
        opened = open_map(file, clip=_clip(part), service_roads=part.service_roads)
        if opened.osm.sha256 != part.sha256:
            raise UserError(f"map {part.map}: is another one than as the sweep began")
        dem = None if part.dem is None else read_dem(Path(part.dem), around=opened.osm.bounds)
        index = index_map(opened.osm, opened.graph, opened.junctions, dem=dem)
        junctions = {junction.summary.id: junction for junction in opened.junctions}
        self._opened = _Opened(part, index, junctions)
        return self._opened


def _clip(part: MapPart) -> NodeClip | LatLonBounds | None:
    if part.node is not None:
        return NodeClip(part.node, part.margin_m)
    return None if part.bounds is None else LatLonBounds(*part.bounds)
