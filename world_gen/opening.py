"""Opens a map: read whole, or, where it is large, clipped from its index on disk."""

from __future__ import annotations

import gc
from collections.abc import Callable, Collection, Sequence
from pathlib import Path

import msgspec
import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.errors import UserError
from foretwin.contracts.frames import GeoPoint, LocalFrame, local_from_geo
from foretwin.world_gen.garbage import rarely_collected
from foretwin.world_gen.junctions.find_intersections import find_intersections
from foretwin.world_gen.junctions.intersections import Junction
from foretwin.world_gen.osm.map_store import MapStore, route_boxes
from foretwin.world_gen.osm.osm_map import LatLonBounds, NoRoadsError, OsmMap
from foretwin.world_gen.osm.read_osm import read_map
from foretwin.world_gen.roads.build_graph import build_road_graph
from foretwin.world_gen.roads.road_graph import EdgeKey, RoadGraph
from foretwin.world_gen.roads.service_roads import with_roads, with_service_roads
from foretwin.world_gen.roads.tidal_roads import with_tides

LARGE_MAP_BYTES = 64_000_000
"""Of larger files, what is needed is clipped from an index on disk, made on first use."""
CLIP_MARGIN_M = 600.0
"""Beyond what is asked for: junctions at the edge must be whole, and know their neighbours."""
MAX_REGION_M = 50_000.0
"""A plane of this size is true to 8 parts in a million at its edges."""


class OpenMap(msgspec.Struct, frozen=True):
    """A map that was read, its roads, and its junctions by id."""

    file: Path
    osm: OsmMap
    graph: RoadGraph
    junctions: tuple[Junction, ...]

    def with_roads(self, added: Sequence[int]) -> OpenMap:
        """Return the map where the edges of these indices count as car roads as well."""
        if not added:
            return self
        return self._of(with_roads(self.graph, added))

    def with_tides(self, driven: Collection[EdgeKey]) -> OpenMap:
        """Return the map with tidal roads driven one way, as the route of these edges drives them;
        without a route as it is."""
        graph = with_tides(self.graph, driven) if driven else self.graph
        return self if graph is self.graph else self._of(graph)

    def _of(self, graph: RoadGraph) -> OpenMap:
        return OpenMap(self.file, self.osm, graph, find_intersections(self.osm, graph))


class Clip(msgspec.Struct, frozen=True):
    """The part of a map that is needed: what lies within `margin_m` of a line (N, 2) of degrees."""

    line_deg: Array
    margin_m: float


class NodeClip(msgspec.Struct, frozen=True):
    """The part of a map that is needed: what lies within `margin_m` of one of its nodes."""

    node: int
    margin_m: float


@rarely_collected()
def open_map(
    file: Path,
    *,
    clip: Clip | NodeClip | LatLonBounds | None = None,
    service_roads: bool = False,
    tides: bool = True,
    large_bytes: int = LARGE_MAP_BYTES,
    open_index: Callable[[Path], MapStore] = MapStore.open,
) -> OpenMap:
    """Read a map, or of a large one what `clip` needs, and find its junctions.

    With `service_roads`, driveways and parking aisles open to cars are roads like any other.
    Without `tides`, tidal roads are open both ways, for who is to drive them (`with_tides`).
    Raises MapError where the file is no map or has no roads there.
    """
    if clip is not None and file.is_file() and file.stat().st_size >= large_bytes:
        osm = _clipped(file, clip, open_index)
    else:
        osm = read_map(file)
    graph = build_road_graph(osm)
    if service_roads:
        graph = with_service_roads(graph)
    if tides:
        graph = with_tides(graph)
    junctions = find_intersections(osm, graph)
    # A map stays for as long as its process: the collector need not visit it again and again.
    gc.freeze()
    return OpenMap(file, osm, graph, junctions)


def region_on_map(file: Path, have: LatLonBounds, wanted: LatLonBounds) -> LatLonBounds:
    """Return what of the wanted bounds lies within those of a map; UserError where nothing does.

    A World lies in one plane about its middle, so bounds far larger than the map would bend it,
    and those of more than `MAX_REGION_M` a side are refused.
    """
    south, west = max(wanted.south, have.south), max(wanted.west, have.west)
    north, east = min(wanted.north, have.north), min(wanted.east, have.east)
    part = LatLonBounds(south=south, west=west, north=north, east=east)
    if part.west >= part.east or part.south >= part.north:
        raise UserError(f"--bbox {_words(wanted)}: outside {file}, which spans {_words(have)}")
    middle = LocalFrame(GeoPoint((part.south + part.north) / 2, (part.west + part.east) / 2))
    corners = local_from_geo(
        middle, np.array([part.south, part.north]), np.array([part.west, part.east])
    )
    side_m = float(np.ptp(corners, axis=0).max())
    if not side_m <= MAX_REGION_M:
        raise UserError(
            f"--bbox {_words(wanted)}: {side_m / 1000:.0f} km a side; at most "
            f"{MAX_REGION_M / 1000:.0f} km"
        )
    return part


def _words(bounds: LatLonBounds) -> str:
    return ",".join(
        f"{angle:.6g}" for angle in (bounds.west, bounds.south, bounds.east, bounds.north)
    )


def _clipped(
    file: Path, clip: Clip | NodeClip | LatLonBounds, open_index: Callable[[Path], MapStore]
) -> OsmMap:
    store = open_index(file)
    try:
        if isinstance(clip, LatLonBounds):
            return store.clip(_widened(region_on_map(file, store.bounds, clip)))
        if isinstance(clip, NodeClip):
            place = store.position_of(clip.node)
            if place is None:
                raise UserError(f"{file}: no way has a node {clip.node}")
            clip = Clip(np.array([place]), clip.margin_m)
        return store.clip_route(clip.line_deg, clip.margin_m + CLIP_MARGIN_M)
    except NoRoadsError:
        spans = _words(store.bounds)
        raise UserError(f"{file}: no road at the place asked for; the map spans {spans}") from None
    finally:
        store.close()


def _widened(bounds: LatLonBounds) -> LatLonBounds:
    low, high = (
        route_boxes(np.array([corner]), CLIP_MARGIN_M)[0]
        for corner in ((bounds.south, bounds.west), (bounds.north, bounds.east))
    )
    return LatLonBounds(south=low.south, west=low.west, north=high.north, east=high.east)
