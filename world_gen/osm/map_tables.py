"""The file of a map index: an SQLite database of packed cells."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import msgspec

from foretwin.world_gen.osm.map_cells import PackedNodes, PackedWays, pack
from foretwin.world_gen.osm.osm_map import LatLonBounds

FORMAT_VERSION = 3
"""Counts changes of the format and of what is kept; part of an index's name."""
KINDS = WAYS, NODES, RELATIONS, NOTES = range(4)
_SCHEMA = """
CREATE TABLE meta (body BLOB NOT NULL);
CREATE TABLE piece (cell INTEGER NOT NULL, kind INTEGER NOT NULL, body BLOB NOT NULL);
CREATE TABLE member_way (id INTEGER PRIMARY KEY, cell INTEGER NOT NULL);
"""


class MapMeta(msgspec.Struct, frozen=True, kw_only=True):
    """What holds for a whole map."""

    sha256: str
    attribution: str
    bounds: LatLonBounds
    """As declared in the file, else those of its roads."""
    origin: tuple[float, float] | None
    """Where the whole map's frame lies; None where the map is too wide for one frame."""
    ways: int
    nodes: int
    notes: tuple[str, ...]


class TableWriter:
    """Writes a new index; no other process sees the file until it is complete."""

    def __init__(self, path: Path) -> None:
        self._db = sqlite3.connect(path, isolation_level=None)
        self._db.executescript(
            "PRAGMA journal_mode=OFF; PRAGMA synchronous=OFF; PRAGMA cache_size=-8000;" + _SCHEMA
        )
        self._db.execute("BEGIN")

    def add(self, cell: int, kind: int, content: PackedWays | PackedNodes | str) -> None:
        """Append a piece of a cell."""
        self._db.execute("INSERT INTO piece VALUES (?, ?, ?)", (cell, kind, pack(content)))

    def add_members(self, rows: Iterable[tuple[int, int]]) -> None:
        """Note in which cell ways stand that relations name."""
        self._db.executemany("INSERT OR REPLACE INTO member_way VALUES (?, ?)", rows)

    def finish(self, meta: MapMeta) -> None:
        """Write what holds for the whole map."""
        self._db.execute("INSERT INTO meta VALUES (?)", (msgspec.msgpack.encode(meta),))
        self._db.execute("CREATE INDEX piece_by_cell ON piece (cell)")
        self._db.execute("COMMIT")

    def close(self) -> None:
        """Close the file, which is of no use unless it is finished."""
        self._db.close()


class TableReader:
    """Reads a complete index; any number of processes may."""

    def __init__(self, path: Path) -> None:
        uri = f"{path.resolve().as_uri()}?mode=ro&immutable=1"
        self._db = sqlite3.connect(uri, uri=True, check_same_thread=False)
        (body,) = self._db.execute("SELECT body FROM meta").fetchone()
        self.meta = msgspec.msgpack.decode(body, type=MapMeta)

    def pieces(self, ranges: Iterable[tuple[int, int]]) -> list[list[bytes]]:
        """Return by kind the bodies of all pieces of ranges of cells, each once."""
        merged: list[list[int]] = []
        for first, last in sorted(ranges):
            if merged and first <= merged[-1][1] + 1:
                merged[-1][1] = max(merged[-1][1], last)
            else:
                merged.append([first, last])
        bodies: list[list[bytes]] = [[] for _ in KINDS]
        select = "SELECT kind, body FROM piece WHERE cell BETWEEN ? AND ? ORDER BY cell, rowid"
        for cells in merged:
            for kind, body in self._db.execute(select, cells):
                bodies[kind].append(body)
        return bodies

    def all_of(self, kind: int) -> Iterator[bytes]:
        """Yield the bodies of all pieces of one kind."""
        for (body,) in self._db.execute("SELECT body FROM piece WHERE kind = ?", (kind,)):
            yield body

    def cells_of(self, ways: Sequence[int]) -> set[int]:
        """Return the cells in which ways stand that relations name."""
        select = "SELECT cell FROM member_way WHERE id = ?"
        return {cell for way in ways for (cell,) in self._db.execute(select, (way,))}

    def close(self) -> None:
        """Close the file."""
        self._db.close()
