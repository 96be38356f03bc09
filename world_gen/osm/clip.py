"""Cut a map out of an index: the ways that touch some boxes, and what belongs to them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from foretwin.contracts.frames import LocalFrame
from foretwin.world_gen.osm.map_assembly import UNITS_PER_DEG, BoolArray, MapObjects, assemble_map
from foretwin.world_gen.osm.map_cells import (
    Boxes,
    CellNodes,
    CellWays,
    cell_ranges,
    sums,
    touches,
    unpack,
)
from foretwin.world_gen.osm.map_tables import NODES, NOTES, RELATIONS, WAYS, TableReader
from foretwin.world_gen.osm.opl import IntArray, NodePositions, TagReader, WayNodes, read_relations
from foretwin.world_gen.osm.osm_map import LatLonBounds, OsmMap, OsmRelation
from foretwin.world_gen.osm.read_osm import is_kept_relation


class _Ways(NamedTuple):
    ids: IntArray
    counts: IntArray
    nodes: IntArray
    lat: IntArray
    lon: IntArray
    tag_texts: list[str]

    def boxes(self) -> Boxes:
        begins = np.cumsum(self.counts) - self.counts
        if not len(begins):
            return Boxes(*(np.empty(0, dtype=np.int64),) * 4)
        edges = ((least, of) for least in (np.minimum, np.maximum) for of in (self.lat, self.lon))
        return Boxes(*(least.reduceat(of, begins) for least, of in edges))

    def only(self, kept: BoolArray) -> _Ways:
        of_node = np.repeat(kept, self.counts)
        tags = [text for text, k in zip(self.tag_texts, kept.tolist(), strict=True) if k]
        return _Ways(
            self.ids[kept],
            self.counts[kept],
            self.nodes[of_node],
            self.lat[of_node],
            self.lon[of_node],
            tags,
        )


class _CellContents(NamedTuple):
    ways: _Ways
    nodes: NodePositions
    node_texts: list[str]
    relations: dict[int, OsmRelation]
    note_places: dict[str, tuple[float, float]]


def clip_map(
    tables: TableReader,
    areas: Sequence[LatLonBounds],
    box: LatLonBounds,
    *,
    file: str,
    frame: LocalFrame,
) -> OsmMap:
    """Return what touches `areas`: ways with all their nodes, their relations, their signals.

    A relation comes with any of its ways; with a building come all of its outlines.
    """
    tags_of = TagReader()
    cells = _read(tables, (r for area in areas for r in cell_ranges(area)), tags_of)
    ways = cells.ways.only(touches(cells.ways.boxes(), areas))
    known = set(ways.ids.tolist())
    relations = {
        key: relation
        for key, relation in sorted(cells.relations.items())
        if any(m.kind == "w" and m.ref in known for m in relation.members)
    }
    ways = _with_outlines(tables, ways, relations, tags_of)
    lat, lon = cells.nodes.lat_1e7, cells.nodes.lon_1e7
    inside = touches(Boxes(lat, lon, lat, lon), areas) | np.isin(cells.nodes.ids, ways.nodes)
    node_tags: dict[int, Mapping[str, str]] = {
        int(cells.nodes.ids[i]): tags_of(cells.node_texts[i])
        for i in sorted(np.flatnonzero(inside).tolist(), key=cells.nodes.ids.__getitem__)
    }
    table = _once(
        NodePositions(
            np.concatenate([ways.nodes, cells.nodes.ids[inside]]),
            np.concatenate([ways.lat, lat[inside]]),
            np.concatenate([ways.lon, lon[inside]]),
        )
    )
    objects = MapObjects(
        way_ids=ways.ids.tolist(),
        way_tags=[tags_of(text) for text in ways.tag_texts],
        way_nodes=WayNodes(ways.nodes, ways.counts),
        positions=table,
        node_tags=node_tags,
        relations=relations,
        notes=list(cells.note_places),
        note_places=cells.note_places,
    )
    meta = tables.meta
    return assemble_map(
        objects,
        file=file,
        sha256=meta.sha256,
        attribution=meta.attribution,
        bounds=box,
        frame=frame,
    )


def find_node(tables: TableReader, node: int) -> tuple[float, float] | None:
    """Return latitude and longitude of a node of a way; None where no way has it.

    Nothing says in which cell a node lies: all are looked through, one after another.
    """
    for body in tables.all_of(WAYS):
        ways = _unpacked(body)
        found = np.flatnonzero(ways.nodes == node)
        if len(found):
            lat, lon = ways.lat[found[0]], ways.lon[found[0]]
            return float(lat) / UNITS_PER_DEG, float(lon) / UNITS_PER_DEG
    return None


def _unpacked(body: bytes) -> _Ways:
    w = unpack(body, CellWays)
    counts = np.frombuffer(w.counts, dtype="<i4").astype(np.int64)
    return _Ways(
        sums(w.ids, "<i8"),
        counts,
        sums(w.nodes, "<i8"),
        sums(w.lat, "<i4"),
        sums(w.lon, "<i4"),
        w.tags.split("\n"),
    )


def _read(
    tables: TableReader, ranges: Iterable[tuple[int, int]], tags_of: TagReader
) -> _CellContents:
    ways: list[_Ways] = []
    nodes: list[NodePositions] = []
    node_texts: list[str] = []
    relations: dict[int, OsmRelation] = {}
    note_places: dict[str, tuple[float, float]] = {}
    for kind, body in tables.pieces(ranges):
        if kind == WAYS:
            ways.append(_unpacked(body))
        elif kind == NODES:
            n = unpack(body, CellNodes)
            nodes.append(NodePositions(sums(n.ids, "<i8"), sums(n.lat, "<i4"), sums(n.lon, "<i4")))
            node_texts.extend(n.tags.split("\n"))
        elif kind == RELATIONS:
            text = unpack(body, str).encode()
            relations.update(read_relations(text, is_kept_relation, tags_of))
        elif kind == NOTES:
            lat, lon, words = unpack(body, str).split(" ", 2)
            note_places[words] = (int(lat) / UNITS_PER_DEG, int(lon) / UNITS_PER_DEG)
    return _CellContents(
        _joined(ways), NodePositions(*_columns(nodes, 3)), node_texts, relations, note_places
    )


def _joined(parts: Sequence[_Ways]) -> _Ways:
    """Join ways of several cells, each way once: a way stands in every cell that it touches."""
    ids, counts, nodes, lat, lon = _columns(parts, 5)
    texts = [text for part in parts for text in part.tag_texts]
    ways = _Ways(ids, counts, nodes, lat, lon, texts)
    _, first = np.unique(ids, return_index=True)
    kept = np.zeros(len(ids), dtype=bool)
    kept[first] = True
    return ways.only(kept)


def _columns(parts: Sequence[tuple[object, ...]], count: int) -> list[IntArray]:
    none = np.empty(0, dtype=np.int64)
    return [np.concatenate([none, *(part[i] for part in parts)]) for i in range(count)]


def _once(positions: NodePositions) -> NodePositions:
    ids, first = np.unique(positions.ids, return_index=True)
    return NodePositions(ids, positions.lat_1e7[first], positions.lon_1e7[first])


def _with_outlines(
    tables: TableReader, ways: _Ways, relations: Mapping[int, OsmRelation], tags_of: TagReader
) -> _Ways:
    """Add the ways that the relations name and that lie beyond the boxes."""
    named = {m.ref for relation in relations.values() for m in relation.members if m.kind == "w"}
    missing = np.array(sorted(named - set(ways.ids.tolist())), dtype=np.int64)
    if not len(missing):
        return ways
    cells = tables.cells_of(missing.tolist())
    beyond = _read(tables, [(cell, cell) for cell in sorted(cells)], tags_of).ways
    beyond = beyond.only(np.isin(beyond.ids, missing))
    return _joined([ways, beyond])
