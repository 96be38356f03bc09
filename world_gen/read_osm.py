"""Read a map file into memory: XML, gzip, bzip2 or PBF, decoded and filtered in C++."""

from __future__ import annotations

import hashlib
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import osmium

from contracts.frames import GeoPoint, LocalFrame
from contracts.world import ATTRIBUTION, DRAWN_ATTRIBUTION, DRAWN_GENERATOR
from world_gen.opl import OplObjects, add_opl
from world_gen.osm_map import LatLonBounds, MapError, OsmMap, OsmWay

WAY_KEYS = ("highway", "railway", "building", "building:part", "area:highway", "barrier")
NODE_KEYS = (
    "highway", "railway", "barrier", "crossing", "traffic_calming", "traffic_sign",
    "traffic_signals", "junction", "stop", "give_way", "kerb", "driving_side",
)  # fmt: skip


def read_map(path: Path) -> OsmMap:
    """Read what matters to a driver from a .osm, .osm.gz, .osm.bz2 or .osm.pbf file.

    The format is recognised by the file's first bytes, not by its name. Nodes that a way names
    and the file lacks are left out of the way; where the gap is in the middle, the longest
    unbroken stretch is kept. Ways and relations stand in the order of their ids, whatever the
    order in the file.

    Raises `MapError` with one line where the file is missing, is no OSM file, is damaged, or
    holds no roads.
    """
    data = _bytes_of(path)
    source = osmium.io.FileBuffer(data, _format_of(path, data))
    try:
        decoded = _Decoded(source)
    except (RuntimeError, ValueError) as error:
        reason = str(error).replace("\n", " ")
        raise MapError(f"{path}: not a readable OSM file: {reason}") from error
    highway_nodes = {
        node for way in decoded.ways.values() if "highway" in way.tags for node in way.nodes
    }
    if not highway_nodes:
        raise MapError(f"{path}: the map holds no roads (no way with a highway tag and positions)")
    box = _bounds_of(decoded.locations[node] for node in highway_nodes)
    centre = GeoPoint((box.south + box.north) / 2.0, (box.west + box.east) / 2.0)
    return OsmMap(
        file=str(path),
        sha256=hashlib.sha256(data).hexdigest(),
        attribution=_attribution(source),
        bounds=decoded.declared_bounds or box,
        frame=LocalFrame(centre),
        locations=decoded.locations,
        node_tags=decoded.node_tags,
        ways=decoded.ways,
        relations=decoded.relations,
    )


def _bytes_of(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except FileNotFoundError:
        raise MapError(f"{path}: there is no such map file") from None
    except IsADirectoryError:
        raise MapError(f"{path}: is a folder, not a map file") from None
    except OSError as error:
        raise MapError(f"{path}: the map file cannot be read: {error.strerror}") from error


def _format_of(path: Path, data: bytes) -> str:
    """Return osmium's name of the format, judged by the first bytes."""
    if data.startswith(b"\x1f\x8b"):
        return "osm.gz"
    if data.startswith(b"BZh"):
        return "osm.bz2"
    if b"OSMHeader" in data[:64]:
        return "pbf"
    if b"<osm" in data[:4096]:
        return "osm"
    raise MapError(
        f"{path}: not an OSM file (expected OSM XML, plain or packed with gzip or bzip2, or PBF)"
    )


class _Decoded:
    """What passes the filters, in plain Python containers."""

    def __init__(self, source: Any) -> None:
        self.declared_bounds = _declared_bounds(source)
        objects = OplObjects()
        store = osmium.index.create_map("flex_mem")
        osm = osmium.osm
        filters = [
            _of_keys(entity, keys)
            for entity, keys in (
                (osm.NODE, NODE_KEYS),
                (osm.WAY, WAY_KEYS),
                (osm.RELATION, ("type",)),
            )
        ]
        _decode(source, osm.NODE | osm.WAY | osm.RELATION, store, filters, objects)
        self.relations = dict(sorted(objects.relations.items()))
        members = {
            member.ref
            for relation in self.relations.values()
            for member in relation.members
            if member.kind == "w"
        }
        missing = sorted(members - objects.ways.keys())
        if missing:
            # Outlines of buildings with courtyards carry their tags on the relation alone.
            _decode(source, osm.WAY, store, [osmium.filter.IdFilter(missing)], objects)
        self.node_tags = objects.node_tags
        self.locations = objects.locations
        self._add_negative(source, objects.ways.values())
        self.ways = {
            key: way
            for key, raw in sorted(objects.ways.items())
            if len((way := _located(raw, self.locations)).nodes) >= 2
        }

    def _add_negative(self, source: Any, ways: Iterable[OsmWay]) -> None:
        """Look up nodes numbered below zero, as editors number what is not yet uploaded.

        osmium's index holds no such ids.
        """
        wanted = {node for way in ways for node in way.nodes if node < 0}
        if wanted - self.locations.keys():
            items: Iterator[Any] = iter(osmium.FileProcessor(source, osmium.osm.NODE))
            for item in items:
                if item.id in wanted and item.location.valid():
                    self.locations[item.id] = (item.location.lat, item.location.lon)


def _of_keys(entity: Any, keys: tuple[str, ...]) -> Any:
    wanted = osmium.filter.KeyFilter(*keys)
    wanted.enable_for(entity)
    return wanted


def _decode(
    source: Any, entities: Any, store: Any, filters: Sequence[Any], objects: OplObjects
) -> None:
    """Add what passes the filters, ways with the locations of `store`, which nodes fill."""
    with_locations = osmium.NodeLocationsForWays(store)
    with_locations.ignore_errors()
    with tempfile.TemporaryDirectory(prefix="foretwin-map-") as folder:
        path = Path(folder) / "filtered.opl"
        target = osmium.io.File(path, "opl,locations_on_ways=true,add_metadata=false")
        with (
            osmium.io.Reader(source, entities) as reader,
            osmium.SimpleWriter(target) as writer,
        ):
            osmium.apply(reader, with_locations, *filters, writer)
        with path.open(encoding="utf-8", newline="\n") as lines:
            add_opl(objects, lines, _is_kept)


def _is_kept(tags: Mapping[str, str]) -> bool:
    kind = tags["type"]
    if kind.split(":")[0] == "restriction" or kind == "building":
        return True
    return kind == "multipolygon" and ("building" in tags or "building:part" in tags)


def _located(way: OsmWay, locations: Mapping[int, tuple[float, float]]) -> OsmWay:
    if all(node in locations for node in way.nodes):
        return way
    longest: list[int] = []
    run: list[int] = []
    for node in way.nodes:
        run = [*run, node] if node in locations else []
        if len(run) > len(longest):
            longest = run
    return OsmWay(way.id, tuple(longest), way.tags)


def _bounds_of(positions: Iterable[tuple[float, float]]) -> LatLonBounds:
    lats, lons = zip(*positions, strict=True)
    return LatLonBounds(min(lats), min(lons), max(lats), max(lons))


def _attribution(source: Any) -> str:
    with osmium.io.Reader(source, osmium.osm.NOTHING) as reader:
        generator = reader.header().get("generator")
    return DRAWN_ATTRIBUTION if generator.startswith(DRAWN_GENERATOR) else ATTRIBUTION


def _declared_bounds(source: Any) -> LatLonBounds | None:
    with osmium.io.Reader(source, osmium.osm.NOTHING) as reader:
        box = reader.header().box()
    if not box.valid():
        return None
    low, high = box.bottom_left, box.top_right
    return LatLonBounds(low.lat, low.lon, high.lat, high.lon)
