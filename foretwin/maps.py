"""Maps, their intersections, and Worlds made of them: what the face reads and writes."""

from __future__ import annotations

import functools
from pathlib import Path

from foretwin.checks import expect, files_told, number, path_of
from foretwin.contracts.codec import SchemaMismatch, read_message, write_message
from foretwin.contracts.did_you_mean import one_of
from foretwin.contracts.errors import UserError
from foretwin.contracts.world import IntersectionSummary, World
from foretwin.orchestrator.embedded import MAP_FILE
from foretwin.orchestrator.worlds.choice import junction_by_id, nearest_junction
from foretwin.orchestrator.worlds.heights import heights_for
from foretwin.orchestrator.worlds.opening import open_map as read_whole
from foretwin.world_gen.build import DEFAULT_RADIUS_M, build_world
from foretwin.world_gen.elevation.dem import DemSet
from foretwin.world_gen.export.formats import FORMATS, ExportOptions, formats_by_suffix
from foretwin.world_gen.junctions.map_index import MapIndex, index_map
from foretwin.world_gen.opening import OpenMap


class Map:
    """A map that was read: its intersections, and Worlds of them."""

    def __init__(self, opened: OpenMap, *, dem: DemSet | None = None) -> None:
        self._opened = opened
        self._dem = dem

    @property
    def attribution(self) -> str:
        """Whose data it is: stands in everything that is made of it."""
        return self._opened.osm.attribution

    @property
    def intersections(self) -> tuple[IntersectionSummary, ...]:
        """Every intersection, as a driver sees it."""
        return tuple(junction.summary for junction in self._opened.junctions)

    def nearest(self, lat_deg: float, lon_deg: float) -> IntersectionSummary:
        """Return the intersection nearest to a place; UserError where there is none near."""
        place = number("lat_deg", lat_deg), number("lon_deg", lon_deg)
        return nearest_junction(self._opened, *place).summary

    def world(self, intersection_id: str, *, radius_m: float = DEFAULT_RADIUS_M) -> World:
        """Return the World within `radius_m` of an intersection, in a frame of its own.

        Raises UserError for an unknown intersection, or a radius that is not between 10 and 2000 m.
        """
        radius_m = number("radius_m", radius_m)
        junction = junction_by_id(self._opened, intersection_id)
        opened, index = self._opened, self._index
        return build_world(opened.osm, opened.graph, junction, radius_m=radius_m, index=index)

    @functools.cached_property
    def _index(self) -> MapIndex:
        return index_map(
            self._opened.osm, self._opened.graph, self._opened.junctions, dem=self._dem
        )


def open_map(
    file: Path | str, *, service_roads: bool = False, dem: Path | str | None = None
) -> Map:
    """Read a map: `.osm`, `.osm.gz`, `.osm.bz2` or `.osm.pbf`.

    With `service_roads`, driveways and parking aisles are roads like any other. With `dem`, an
    elevation model (`.hgt`, `.hgt.zip`, GeoTIFF, or a folder of these), its Worlds have heights.
    Raises MapError, a UserError, where the file is no map or has no roads, UserError for an
    elevation model that cannot be read or lies elsewhere.
    """
    opened = read_whole(path_of("file", file), service_roads=service_roads)
    heights = heights_for(opened, None if dem is None else path_of("dem", dem))
    return Map(opened, dem=heights)


def drawn_town() -> Map:
    """Read the map of the small town that comes with foretwin."""
    return open_map(MAP_FILE)


def export_formats() -> dict[str, str]:
    """Return how the files of each format end that `export_world` writes."""
    return {name: format_.suffix for name, format_ in FORMATS.items()}


def export_world(world: World, file: Path | str, *, format_name: str | None = None) -> Path:
    """Write a World for another program; the file's suffix says as what where no format is named.

    Raises UserError where neither says, or where the file cannot be written.
    """
    file = path_of("file", file)
    world = expect("world", world, World)
    named = formats_by_suffix(file.suffix)
    if format_name is None and len(named) != 1:
        wish = f"one of {', '.join(named)}" if named else f"one of {', '.join(FORMATS)}"
        raise UserError(f"{file}: its suffix names no one format; give format_name, {wish}")
    name = named[0] if format_name is None else format_name
    if name not in FORMATS:
        raise UserError(f"format {name!r} is unknown; {one_of(name, FORMATS)}")
    with files_told(file):
        FORMATS[name].write(world, file, ExportOptions())
    return file


def save_world(world: World, file: Path | str) -> Path:
    """Write a World as foretwin keeps it; `read_world` reads it again.

    Raises UserError where the file cannot be written.
    """
    file = path_of("file", file)
    with files_told(file):
        write_message(expect("world", world, World), file)
    return file


def read_world(file: Path | str) -> World:
    """Return a World that foretwin wrote; UserError where the file holds none."""
    try:
        with files_told(file := path_of("file", file)):
            return read_message(file, World)
    except SchemaMismatch as error:
        raise UserError(str(error)) from error
