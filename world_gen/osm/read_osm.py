"""Read a map file into memory: XML, gzip, bzip2 or PBF, decoded in C++, taken over in bulk."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from functools import cache
from itertools import compress
from pathlib import Path

import osmium

from foretwin.contracts.owned_folder import temporary_folder
from foretwin.world_gen.osm import opl
from foretwin.world_gen.osm.map_assembly import MapObjects, assemble_map, sorted_positions
from foretwin.world_gen.osm.map_file import (
    HEAD_BYTES,
    MapHeader,
    check_packing,
    file_fault,
    format_of,
    unreadable,
)
from foretwin.world_gen.osm.opl_filter import decode
from foretwin.world_gen.osm.osm_map import OsmMap, OsmRelation

WAY_KEYS = ("highway", "railway", "building", "building:part", "area:highway", "barrier")
NODE_KEYS = (
    "highway",
    "railway",
    "barrier",
    "crossing",
    "traffic_calming",
    "traffic_sign",
    "traffic_signals",
    "junction",
    "stop",
    "give_way",
    "kerb",
)
WAY_TAGS = ("amenity=shelter",)
NODE_TAGS = ("natural=tree", "power=pole", "amenity=shelter")
WANTED_WAYS = opl.any_tag(WAY_KEYS, WAY_TAGS)
WANTED_NODES = opl.any_tag(NODE_KEYS, NODE_TAGS)
DECODE_ERRORS = (RuntimeError, ValueError, IndexError, MemoryError, osmium.InvalidLocationError)
"""All that osmium raises for a file that is damaged."""


def read_map(path: Path) -> OsmMap:
    """Read what matters to a driver from a .osm, .osm.gz, .osm.bz2 or .osm.pbf file.

    The format is recognised by the file's first bytes, not by its name. Nodes that a way names
    and the file lacks are left out of the way; where the gap is in the middle, the longest
    unbroken stretch is kept; the map's notes name the way. Ways and relations stand in the order
    of their ids, whatever the order in the file.

    Raises `MapError` with one line where the file is missing, is no OSM file, is damaged, or
    holds no roads.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise file_fault(path, error) from None
    form = format_of(path, data[:HEAD_BYTES])
    check_packing(path, form)
    try:
        header, text = _as_opl(data, form)
    except DECODE_ERRORS as error:
        raise unreadable(path, error) from error
    digest = hashlib.sha256(data).hexdigest()
    return assemble_map(_objects(text), header, file=str(path), sha256=digest)


def _as_opl(data: bytes, form: str) -> tuple[MapHeader, bytes]:
    with temporary_folder("foretwin-map-") as folder:
        path = folder / "map.opl"
        header = decode(osmium.io.FileBuffer(data, form), osmium.io.File(path, opl.OPL_OPTIONS))
        return MapHeader.of(**header), path.read_bytes()


def _objects(text: bytes) -> MapObjects:
    """Return the ways for drivers, the outlines that kept relations name, and their nodes."""
    tags_of = opl.tag_reader()
    # Most texts of tags come again and again.
    is_wanted_node, is_wanted_way = cache(WANTED_NODES.search), cache(WANTED_WAYS.search)
    positions: list[opl.NodePositions] = []
    node_tags: dict[int, Mapping[str, str]] = {}
    ways = opl.WayLines([], [], [])
    relations: dict[int, OsmRelation] = {}
    for letter, section in opl.sections(text):
        if letter == "n":
            nodes = opl.read_nodes(section, is_wanted_node)
            positions.append(nodes.positions)
            node_tags.update((node, tags_of(tags)) for node, tags in nodes.tag_texts.items())
        elif letter == "w":
            more = opl.way_lines(section)
            ways.ids.extend(more.ids)
            ways.tag_texts.extend(more.tag_texts)
            ways.node_texts.extend(more.node_texts)
        else:
            relations.update(opl.read_relations(section, is_kept_relation, tags_of))
    # Outlines of buildings with courtyards carry their tags on the relation alone.
    members = {way for relation in relations.values() for way in relation.way_ids}
    kept = [w in members or is_wanted_way(t) for w, t in zip(ways.ids, ways.tag_texts, strict=True)]
    notes: list[str] = []
    return MapObjects(
        way_ids=list(compress(ways.ids, kept)),
        way_tags=[tags_of(tags) for tags in compress(ways.tag_texts, kept)],
        way_nodes=opl.way_nodes(list(compress(ways.node_texts, kept))),
        positions=sorted_positions(positions, notes),
        node_tags=node_tags,
        relations=dict(sorted(relations.items())),
        notes=notes,
    )


def is_kept_relation(tags: Mapping[str, str]) -> bool:
    """Return whether a relation is a turn restriction or a building."""
    kind = tags.get("type", "")
    if kind.split(":")[0] == "restriction" or kind == "building":
        return True
    return kind == "multipolygon" and ("building" in tags or "building:part" in tags)
