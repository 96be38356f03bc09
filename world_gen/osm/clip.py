"""Cut a map out of an index: the ways that touch some boxes, and what belongs to them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

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
from foretwin.world_gen.osm.map_file import MapHeader
from foretwin.world_gen.osm.map_tables import NODES, NOTES, RELATIONS, WAYS, TableReader
from foretwin.world_gen.osm.osm_map import LatLonBounds, OsmMap, OsmRelation
from foretwin.world_gen.osm.read_osm import is_kept_relation


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
    pieces = tables.pieces(row for area in areas for row in cell_ranges(area))
    ways = _joined([WayTable.unpacked(body) for body in pieces[WAYS]])
    ways = ways.rows(np.flatnonzero(touches(ways.boxes(), areas)))
    known = set(ways.ids.tolist())
    text = "".join(unpack(body, str) for body in pieces[RELATIONS]).encode()
    in_cells = opl.read_relations(text, is_kept_relation, tags_of)
    relations = {k: r for k, r in sorted(in_cells.items()) if not known.isdisjoint(r.way_ids)}
    ways = _with_outlines(tables, ways, relations)
    tagged = [unpack_nodes(body) for body in pieces[NODES]]
    nodes = opl.NodePositions.joined(positions for positions, _ in tagged)
    texts = [text for _, of_cell in tagged for text in of_cell]
    inside = touches(Boxes.at(nodes), areas) | np.isin(nodes.ids, ways.nodes.ids)
    rows = sorted(np.flatnonzero(inside).tolist(), key=nodes.ids.__getitem__)
    positions = opl.NodePositions.joined([ways.nodes, nodes.rows(inside)])
    _, first = np.unique(positions.ids, return_index=True)
    note_places = {}
    for body in pieces[NOTES]:
        lat, lon, words = unpack(body, str).split(" ", 2)
        note_places[words] = (int(lat) / opl.UNITS_PER_DEG, int(lon) / opl.UNITS_PER_DEG)
    objects = MapObjects(
        way_ids=ways.ids.tolist(),
        way_tags=[tags_of(text) for text in ways.tag_texts],
        way_nodes=opl.WayNodes(ways.nodes.ids, ways.counts),
        positions=positions.rows(first),
        node_tags={int(nodes.ids[row]): tags_of(texts[row]) for row in rows},
        relations=relations,
        notes=list(note_places),
        note_places=note_places,
    )
    header = MapHeader(tables.meta.attribution, box)
    return assemble_map(objects, header, file=file, sha256=tables.meta.sha256, frame=frame)


def find_node(tables: TableReader, node: int) -> tuple[float, float] | None:
    """Return latitude and longitude of a node of a way; None where no way has it.

    No table has the cell of a node: all are looked through, one after another.
    """
    for body in tables.all_of(WAYS):
        nodes = WayTable.unpacked(body).nodes
        found = np.flatnonzero(nodes.ids == node)
        if len(found):
            return nodes.at(found[0])
    return None


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
    tables: TableReader, ways: WayTable, relations: Mapping[int, OsmRelation]
) -> WayTable:
    """Add the ways that the relations name and that lie beyond the boxes."""
    named = {way for relation in relations.values() for way in relation.way_ids}
    missing = np.array(sorted(named - set(ways.ids.tolist())), dtype=np.int64)
    if not len(missing):
        return ways
    cells = tables.cells_of(missing.tolist())
    pieces = tables.pieces((cell, cell) for cell in cells)
    beyond = _joined([WayTable.unpacked(body) for body in pieces[WAYS]])
    beyond = beyond.rows(np.flatnonzero(np.isin(beyond.ids, missing)))
    return _joined([ways, beyond])
