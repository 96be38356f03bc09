"""Read a map file into memory: XML, gzip, bzip2 or PBF, decoded and filtered in C++."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import osmium

from contracts.frames import GeoPoint, LocalFrame
from world_gen.osm_map import LatLonBounds, MapError, OsmMap, OsmMember, OsmRelation, OsmWay

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
        store = osmium.index.create_map("flex_mem")
        self.declared_bounds = _declared_bounds(source)
        self.node_tags: dict[int, dict[str, str]] = {}
        ways: dict[int, OsmWay] = {}
        relations: dict[int, OsmRelation] = {}
        for item in _filtered(source, store):
            if item.is_node():
                self.node_tags[item.id] = _tags(item)
            elif item.is_way():
                ways[item.id] = _way(item)
            else:
                relation = _relation(item)
                if relation is not None:
                    relations[item.id] = relation
        members = {
            member.ref
            for relation in relations.values()
            for member in relation.members
            if member.kind == "w"
        }
        # Outlines of buildings with courtyards carry their tags on the relation alone.
        for item in _by_id(source, osmium.osm.WAY, members - ways.keys()):
            ways[item.id] = _way(item)
        self.relations = dict(sorted(relations.items()))
        wanted = {node for way in ways.values() for node in way.nodes}
        wanted.update(self.node_tags)
        self.locations = _locations(source, store, wanted)
        self.ways = {
            key: way
            for key, raw in sorted(ways.items())
            if len((way := _located(raw, self.locations)).nodes) >= 2
        }


def _filtered(source: Any, store: Any) -> Iterator[Any]:
    osm = osmium.osm
    processor = osmium.FileProcessor(source, osm.NODE | osm.WAY | osm.RELATION)
    processor.with_locations(store)
    for entity, keys in (
        (osm.NODE, NODE_KEYS),
        (osm.WAY, WAY_KEYS),
        (osm.RELATION, ("type",)),
    ):
        wanted = osmium.filter.KeyFilter(*keys)
        wanted.enable_for(entity)
        processor.with_filter(wanted)
    return iter(processor)


def _by_id(source: Any, entity: Any, ids: set[int]) -> Iterator[Any]:
    if not ids:
        return iter(())
    return iter(
        osmium.FileProcessor(source, entity).with_filter(osmium.filter.IdFilter(sorted(ids)))
    )


def _tags(item: Any) -> dict[str, str]:
    return {tag.k: tag.v for tag in item.tags}


def _way(item: Any) -> OsmWay:
    return OsmWay(item.id, tuple([node.ref for node in item.nodes]), _tags(item))


def _relation(item: Any) -> OsmRelation | None:
    tags = _tags(item)
    restriction = tags["type"].split(":")[0] == "restriction"
    building = tags["type"] in ("multipolygon", "building") and (
        "building" in tags or "building:part" in tags or tags["type"] == "building"
    )
    if not (restriction or building):
        return None
    members = tuple(OsmMember(member.type, member.ref, member.role) for member in item.members)
    return OsmRelation(item.id, members, tags)


def _locations(source: Any, store: Any, wanted: set[int]) -> dict[int, tuple[float, float]]:
    found: dict[int, tuple[float, float]] = {}
    negative: set[int] = set()
    for node in sorted(wanted):
        if node < 0:
            negative.add(node)
            continue
        try:
            location = store.get(node)
        except KeyError:
            continue
        if location.valid():
            found[node] = (location.lat, location.lon)
    if negative:
        # Editors number what is not yet uploaded below zero; osmium's index holds no such ids.
        items: Iterator[Any] = iter(osmium.FileProcessor(source, osmium.osm.NODE))
        for item in items:
            if item.id in negative and item.location.valid():
                found[item.id] = (item.location.lat, item.location.lon)
    return found


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


def _declared_bounds(source: Any) -> LatLonBounds | None:
    with osmium.io.Reader(source, osmium.osm.NOTHING) as reader:
        box = reader.header().box()
    if not box.valid():
        return None
    low, high = box.bottom_left, box.top_right
    return LatLonBounds(low.lat, low.lon, high.lat, high.lon)
