"""Build the index of a map of any size, in bounded memory.

One pass decodes the file: positions of nodes, ways and kept relations go to files. Then ways are
taken in batches, their nodes looked up, and each is put into the cells that it touches.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from itertools import pairwise
from pathlib import Path

import numpy as np

from foretwin.world_gen.osm import opl
from foretwin.world_gen.osm.map_assembly import (
    NO_WAYS,
    WayNote,
    on_earth,
    sound_ways,
)
from foretwin.world_gen.osm.map_bounds import (
    believed_bounds,
    bounds_of,
    centre_of,
    reach_deg,
)
from foretwin.world_gen.osm.map_cells import Boxes, WayTable, pack_nodes, place
from foretwin.world_gen.osm.map_tables import NODES, NOTES, RELATIONS, WAYS, MapMeta, TableWriter
from foretwin.world_gen.osm.node_spool import NodeSpool
from foretwin.world_gen.osm.opl_stream import OplStream, Progress
from foretwin.world_gen.osm.osm_map import BoolArray, IntArray, LatLonBounds, NoRoadsError, rows_of
from foretwin.world_gen.osm.read_osm import WANTED_NODES, WANTED_WAYS, is_kept_relation

BATCH_BYTES = 24 << 20
"""Text of ways that is looked at in one go; some 2 million nodes of ways."""
LINES_BYTES = 4 << 20
WIDEST_FRAME_DEG = 2.0
"""Up to this width a map has one frame, the same as when it is read as a whole."""
MOST_NOTES = 1000


def build_map_store(map_file: Path, part: Path, target: Path, progress: Progress | None) -> str:
    """Write the index to `target`, with `part` as folder for what is needed meanwhile.

    Returns the map's SHA-256. Raises `MapError` where the map cannot be read or has no roads.
    """
    with closing(TableWriter(target)) as table, closing(NodeSpool(part)) as nodes:
        with (
            OplStream(map_file, progress) as stream,
            (part / "ways.opl").open("wb") as ways,
            (part / "relations.opl").open("wb") as relations,
        ):
            members: list[IntArray] = []
            for block in stream.blocks():
                for letter, section in opl.sections(block):
                    if letter == "n":
                        found = opl.read_nodes(section, WANTED_NODES.search)
                        nodes.add(found.positions)
                        _add_tagged(table, found)
                    elif letter == "w":
                        ways.write(section)
                    else:
                        members.append(_add_relations(section, relations.write))
        nodes.finish()
        batches = _WayBatches(table, nodes, np.unique(np.concatenate([_NONE, *members])))
        for lines in _batches(part / "ways.opl", batches.members):
            batches.add(lines)
        _place_relations(table, part / "relations.opl", batches, nodes.notes)
        box = batches.road_box(map_file)
        centre = centre_of(box)
        bounds, words = believed_bounds(stream.header.bounds, box)
        meta = MapMeta(
            sha256=stream.sha256,
            attribution=stream.header.attribution,
            bounds=bounds,
            origin=(centre.lat_deg, centre.lon_deg) if reach_deg(box) <= WIDEST_FRAME_DEG else None,
            ways=batches.count,
            nodes=nodes.count,
            notes=tuple(dict.fromkeys((*words, *nodes.notes)))[:MOST_NOTES],
        )
        table.finish(meta)
    return meta.sha256


_NONE: IntArray = np.empty(0, dtype=np.int64)


def _add_tagged(table: TableWriter, found: opl.NodeObjects) -> None:
    if not found.tag_texts:
        return
    tagged = np.isin(found.positions.ids, np.array(list(found.tag_texts)))
    nodes = found.positions.rows(tagged & on_earth(found.positions))
    for cell, at in _by_cell(*place(Boxes.at(nodes))):
        mine = nodes.rows(at)
        table.add(cell, NODES, pack_nodes(mine, [found.tag_texts[n] for n in mine.ids.tolist()]))


def _add_relations(section: bytes, write: Callable[[bytes], object]) -> IntArray:
    tags_of = opl.tag_reader()
    members: list[int] = []
    for line in section.split(b"\n"):
        found = opl.read_relations(line, is_kept_relation, tags_of) if b"type=" in line else {}
        for relation in found.values():
            write(line + b"\n")
            members.extend(relation.way_ids)
    return np.array(members, dtype=np.int64)


def _batches(path: Path, members: IntArray) -> Iterator[opl.WayLines]:
    """Yield the ways that matter, as many at a time as fit into a batch."""
    wanted = set(members.tolist())
    batch, size = opl.WayLines([], [], []), 0
    with path.open("rb") as file:
        while lines := file.readlines(LINES_BYTES):
            some = opl.way_lines(b"".join(lines))
            for way, tags, nodes in zip(*some, strict=True):
                if way in wanted or WANTED_WAYS.search(tags):
                    batch.ids.append(way)
                    batch.tag_texts.append(tags)
                    batch.node_texts.append(nodes)
                    size += len(tags) + len(nodes)
            if size >= BATCH_BYTES:
                yield batch
                batch, size = opl.WayLines([], [], []), 0
    if batch.ids:
        yield batch


class _WayBatches:
    """Puts ways into cells, and remembers where those are that relations name."""

    def __init__(self, table: TableWriter, nodes: NodeSpool, members: IntArray) -> None:
        self.members = members
        self.member_boxes = Boxes(*(np.full(len(members), -1, dtype=np.int64) for _ in range(4)))
        self.member_placed: BoolArray = np.zeros(len(members), dtype=bool)
        self.count = 0
        self._table = table
        self._nodes = nodes
        self._road_extremes: list[opl.NodePositions] = []

    def add(self, lines: opl.WayLines) -> None:
        """Look up the nodes of a batch and put its ways into their cells."""
        nodes = opl.way_nodes(lines.node_texts)
        positions = self._nodes.find(nodes.nodes)
        is_road = np.array([_is_road(text) for text in lines.tag_texts], dtype=bool)
        sound = sound_ways(lines.ids, is_road, nodes, positions)
        self._note(sound.notes, positions)
        ways = WayTable(
            np.array(lines.ids, dtype=np.int64)[sound.picked],
            sound.nodes.counts,
            positions.rows(sound.rows),
            [lines.tag_texts[i] for i in sound.picked.tolist()],
        )
        placed = place(ways.boxes())
        for cell, at in _by_cell(*placed):
            self._table.add(cell, WAYS, ways.rows(at).packed())
        self._remember(ways, placed.cells[: len(ways.ids)])
        roads = np.repeat(is_road[sound.picked], ways.counts)
        self._road_extremes.append(_extremes(ways.nodes.rows(roads)))
        self.count += len(ways.ids)

    def _remember(self, ways: WayTable, cells: IntArray) -> None:
        rows, named = rows_of(self.members, ways.ids)
        for column, values in zip(self.member_boxes, ways.boxes(), strict=True):
            column[rows[named]] = values[named]
        self.member_placed[rows[named]] = True
        self._table.add_members(zip(ways.ids[named].tolist(), cells[named].tolist(), strict=True))

    def _note(self, notes: Sequence[WayNote], positions: opl.NodePositions) -> None:
        """Put notes on a way where its first known node is."""
        for text, row in notes:
            if row is not None:
                at = positions.rows(np.array([row]))
                cell = int(place(Boxes.at(at)).cells[0])
                self._table.add(cell, NOTES, f"{at.lat_1e7[0]} {at.lon_1e7[0]} {text}")
            else:
                self._nodes.notes.append(text)

    def road_box(self, map_file: Path) -> LatLonBounds:
        """Return the box around all roads."""
        lat_lon_deg = opl.NodePositions.joined(self._road_extremes).lat_lon_deg
        if not len(lat_lon_deg):
            raise NoRoadsError(str(map_file))
        return bounds_of(str(map_file), lat_lon_deg, widest_deg=360.0)


def _is_road(tag_text: str) -> bool:
    return tag_text.startswith("highway=") or ",highway=" in tag_text


def _extremes(nodes: opl.NodePositions) -> opl.NodePositions:
    """Return the few positions that set a box, whether or not it crosses the antimeridian."""
    _, lat, lon = nodes
    if not len(lat):
        return nodes
    beyond = np.where(lon < 0, lon + 360 * opl.UNITS_PER_DEG, lon)
    rows = [np.argmin(lat), np.argmax(lat), np.argmin(lon), np.argmax(lon)]
    rows += [np.argmin(beyond), np.argmax(beyond)]
    return nodes.rows(np.array(rows))


def _by_cell(cells: IntArray, held: IntArray) -> Iterator[tuple[int, IntArray]]:
    """Yield every cell with what it holds, in the order given."""
    order = np.argsort(cells, kind="stable")
    cells, held = cells[order], held[order]
    cuts = [*np.flatnonzero(np.diff(cells, prepend=-1)).tolist(), len(cells)]
    for begin, end in pairwise(cuts):
        yield int(cells[begin]), held[begin:end]


def _place_relations(table: TableWriter, path: Path, ways: _WayBatches, notes: list[str]) -> None:
    tags_of = opl.tag_reader()
    with path.open("rb") as file:
        while lines := file.readlines(LINES_BYTES):
            of_cell: dict[int, list[str]] = {}
            for line in lines:
                (relation,) = opl.read_relations(line, is_kept_relation, tags_of).values()
                rows = np.searchsorted(ways.members, np.array(relation.way_ids, dtype=np.int64))
                rows = rows[ways.member_placed[rows]]
                if not len(rows):
                    notes.append(f"relation {relation.id}: {NO_WAYS}")
                else:
                    south, west, north, east = (column[rows] for column in ways.member_boxes)
                    lows = (edge.min(keepdims=True) for edge in (south, west))
                    highs = (edge.max(keepdims=True) for edge in (north, east))
                    box = Boxes(*lows, *highs)
                    for cell in place(box).cells.tolist():
                        of_cell.setdefault(cell, []).append(line.decode())
            for cell, texts in sorted(of_cell.items()):
                table.add(cell, RELATIONS, "".join(texts))
            tags_of = opl.tag_reader()
