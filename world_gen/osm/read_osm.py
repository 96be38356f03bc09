"""Read a map file into memory: XML, gzip, bzip2 or PBF, decoded in C++, taken over in bulk."""

from __future__ import annotations

import ctypes
import hashlib
import tempfile
from collections.abc import Mapping
from itertools import compress
from pathlib import Path
from typing import Any

import osmium

from foretwin.world_gen.osm.map_assembly import MapObjects, assemble_map, sorted_positions
from foretwin.world_gen.osm.map_file import (
    HEAD_BYTES,
    MapHeader,
    file_fault,
    format_of,
    header_of,
    unreadable,
)
from foretwin.world_gen.osm.opl import (
    OPL_OPTIONS,
    NodePositions,
    TagReader,
    WantedTags,
    WayLines,
    read_nodes,
    read_relations,
    sections,
    way_lines,
    way_nodes,
)
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
    "driving_side",
)


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
    try:
        header, text = _as_opl(data, form)
    except DECODE_ERRORS as error:
        raise unreadable(path, error) from error
    objects = DecodedObjects()
    objects.add(text)
    return assemble_map(
        objects.for_map(),
        file=str(path),
        sha256=hashlib.sha256(data).hexdigest(),
        attribution=header.attribution,
        bounds=header.bounds,
    )


def _as_opl(data: bytes, form: str) -> tuple[MapHeader, bytes]:
    with tempfile.TemporaryDirectory(prefix="foretwin-map-") as folder:
        path = Path(folder) / "map.opl"
        with osmium.io.Reader(osmium.io.FileBuffer(data, form)) as reader:
            header = header_of(reader.header())
            writer = osmium.SimpleWriter(osmium.io.File(path, OPL_OPTIONS))
            try:
                osmium.apply(reader, writer)
            finally:
                _close(writer)
        return header, path.read_bytes()


def _close(writer: Any) -> None:
    """Close a writer; one that has failed, on text that is no UTF-8, must never be destroyed.

    Its destructor would try once more, fail, and with it end the whole process.
    """
    try:
        writer.close()
    except BaseException:
        ctypes.pythonapi.Py_IncRef(ctypes.py_object(writer))
        raise


class DecodedObjects:
    """What of a map's objects may matter to a driver, as they come in."""

    def __init__(self) -> None:
        self._tags_of = TagReader()
        self._wanted_nodes = WantedTags(NODE_KEYS, self._tags_of)
        self._positions: list[NodePositions] = []
        self._node_tags: dict[int, Mapping[str, str]] = {}
        self._ways = WayLines([], [], [])
        self._relations: dict[int, OsmRelation] = {}

    def add(self, text: bytes) -> None:
        """Add whole lines of OPL."""
        for letter, section in sections(text):
            if letter == "n":
                nodes = read_nodes(section, self._wanted_nodes.__getitem__)
                self._positions.append(nodes.positions)
                self._node_tags.update((n, self._tags_of(t)) for n, t in nodes.tag_texts.items())
            elif letter == "w":
                more = way_lines(section)
                self._ways.ids.extend(more.ids)
                self._ways.tag_texts.extend(more.tag_texts)
                self._ways.node_texts.extend(more.node_texts)
            else:
                self._relations.update(read_relations(section, is_kept_relation, self._tags_of))

    def for_map(self) -> MapObjects:
        """Return the ways for drivers, the outlines that kept relations name, and their nodes."""
        notes: list[str] = []
        wanted = WantedTags(WAY_KEYS, self._tags_of)
        ways = self._ways
        tags = [wanted[text] for text in ways.tag_texts]
        # Outlines of buildings with courtyards carry their tags on the relation alone.
        members = {m.ref for r in self._relations.values() for m in r.members if m.kind == "w"}
        if members:
            for i, way in enumerate(ways.ids):
                if way in members and tags[i] is None:
                    tags[i] = self._tags_of(ways.tag_texts[i])
        kept = [of_way is not None for of_way in tags]
        return MapObjects(
            way_ids=list(compress(ways.ids, kept)),
            way_tags=[of_way for of_way in tags if of_way is not None],
            way_nodes=way_nodes(list(compress(ways.node_texts, kept))),
            positions=sorted_positions(self._positions, notes),
            node_tags=self._node_tags,
            relations=dict(sorted(self._relations.items())),
            notes=notes,
        )


def is_kept_relation(tags: Mapping[str, str]) -> bool:
    """Return whether a relation is a turn restriction or a building."""
    kind = tags.get("type", "")
    if kind.split(":")[0] == "restriction" or kind == "building":
        return True
    return kind == "multipolygon" and ("building" in tags or "building:part" in tags)
