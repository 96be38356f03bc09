"""Cut a map out of an index: the ways that touch some boxes, and what belongs to them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from foretwin.contracts.frames import LocalFrame
from foretwin.world_gen.osm import opl
from foretwin.world_gen.osm.map_assembly import MapObjects, assemble_map
from foretwin.world_gen.osm.map_cells import (
    Boxes,
    WayTable,
    cell_ranges,
    touches,
    unpack,
    unpack_nodes,
)
from foretwin.world_gen.osm.map_tables import NODES, NOTES, RELATIONS, WAYS, TableReader
from foretwin.world_gen.osm.osm_map import LatLonBounds, OsmMap, OsmRelation
from foretwin.world_gen.osm.read_osm import is_kept_relation


class _CellContents(NamedTuple):
    ways: WayTable
    nodes: opl.NodePositions
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
    tags_of = opl.tag_reader()
    cells = _read(tables, (r for area in areas for r in cell_ranges(area)), tags_of)
    ways = cells.ways.rows(np.flatnonzero(touches(cells.ways.boxes(), areas)))
    known = set(ways.ids.tolist())
    relations = {
        key: relation
        for key, relation in sorted(cells.relations.items())
        if not known.isdisjoint(relation.way_ids)
    }
    ways = _with_outlines(tables, ways, relations, tags_of)
    inside = touches(Boxes.at(cells.nodes), areas) | np.isin(cells.nodes.ids, ways.nodes.ids)
    node_tags: dict[int, Mapping[str, str]] = {
        int(cells.nodes.ids[i]): tags_of(cells.node_texts[i])
        for i in sorted(np.flatnonzero(inside).tolist(), key=cells.nodes.ids.__getitem__)
    }
    positions = opl.NodePositions.joined([ways.nodes, cells.nodes.rows(inside)])
    _, first = np.unique(positions.ids, return_index=True)
    objects = MapObjects(
        way_ids=ways.ids.tolist(),
        way_tags=[tags_of(text) for text in ways.tag_texts],
        way_nodes=opl.WayNodes(ways.nodes.ids, ways.counts),
        positions=positions.rows(first),
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
        nodes = WayTable.unpacked(body).nodes
        found = np.flatnonzero(nodes.ids == node)
        if len(found):
            return nodes.at(found[0])
    return None


def _read(
    tables: TableReader, ranges: Iterable[tuple[int, int]], tags_of: opl.TagsOf
) -> _CellContents:
    ways: list[WayTable] = []
    nodes: list[opl.NodePositions] = []
    node_texts: list[str] = []
    relations: dict[int, OsmRelation] = {}
    note_places: dict[str, tuple[float, float]] = {}
    for kind, body in tables.pieces(ranges):
        if kind == WAYS:
            ways.append(WayTable.unpacked(body))
        elif kind == NODES:
            positions, texts = unpack_nodes(body)
            nodes.append(positions)
            node_texts.extend(texts)
        elif kind == RELATIONS:
            text = unpack(body, str).encode()
            relations.update(opl.read_relations(text, is_kept_relation, tags_of))
        elif kind == NOTES:
            lat, lon, words = unpack(body, str).split(" ", 2)
            note_places[words] = (int(lat) / opl.UNITS_PER_DEG, int(lon) / opl.UNITS_PER_DEG)
    positions = opl.NodePositions.joined(nodes)
    return _CellContents(_joined(ways), positions, node_texts, relations, note_places)


def _joined(parts: Sequence[WayTable]) -> WayTable:
    """Join ways of several cells, each way once: a way stands in every cell that it touches."""
    none = np.empty(0, dtype=np.int64)
    ids = np.concatenate([none, *(part.ids for part in parts)])
    counts = np.concatenate([none, *(part.counts for part in parts)])
    nodes = opl.NodePositions.joined(part.nodes for part in parts)
    texts = [text for part in parts for text in part.tag_texts]
    _, first = np.unique(ids, return_index=True)
    return WayTable(ids, counts, nodes, texts).rows(np.sort(first))


def _with_outlines(
    tables: TableReader, ways: WayTable, relations: Mapping[int, OsmRelation], tags_of: opl.TagsOf
) -> WayTable:
    """Add the ways that the relations name and that lie beyond the boxes."""
    named = {way for relation in relations.values() for way in relation.way_ids}
    missing = np.array(sorted(named - set(ways.ids.tolist())), dtype=np.int64)
    if not len(missing):
        return ways
    cells = tables.cells_of(missing.tolist())
    beyond = _read(tables, [(cell, cell) for cell in sorted(cells)], tags_of).ways
    beyond = beyond.rows(np.flatnonzero(np.isin(beyond.ids, missing)))
    return _joined([ways, beyond])
