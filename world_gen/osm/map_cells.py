"""The cells of a map index: which cell holds what, and how a cell's objects are packed."""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import Any, NamedTuple

import msgspec
import numpy as np

from foretwin.world_gen.osm.opl import NodePositions
from foretwin.world_gen.osm.osm_map import BoolArray, IntArray, LatLonBounds

FINEST_LEVEL = 13
"""360 degrees halved this often: cells of 0.044 degrees, some 5 by 3 km in Germany."""
_UNITS_AROUND = 3_600_000_000


class Boxes(NamedTuple):
    """South, west, north and east edges (N,) each, in units of 1e-7 degrees."""

    south: IntArray
    west: IntArray
    north: IntArray
    east: IntArray

    @staticmethod
    def at(nodes: NodePositions) -> Boxes:
        """Return boxes that are but points."""
        return Boxes(nodes.lat_1e7, nodes.lon_1e7, nodes.lat_1e7, nodes.lon_1e7)


class BoxCells(NamedTuple):
    """Cells (M,) and which of the given boxes (M,) each of them holds."""

    cells: IntArray
    boxes: IntArray


def place(boxes: Boxes) -> BoxCells:
    """Return the cells that hold each box: at the finest level where it touches at most 2 by 2."""
    span = np.maximum(np.maximum(boxes.north - boxes.south, boxes.east - boxes.west), 1)
    level = np.floor(np.log2(_UNITS_AROUND / span)).astype(np.int64).clip(0, FINEST_LEVEL)
    size = _UNITS_AROUND >> level
    south, north = ((edge + 900_000_000) // size for edge in (boxes.south, boxes.north))
    west, east = ((edge + 1_800_000_000) // size for edge in (boxes.west, boxes.east))
    cells, held = [], []
    for more_x, more_y in ((0, 0), (1, 0), (0, 1), (1, 1)):
        x, y = west + more_x, south + more_y
        there = np.flatnonzero((x <= east) & (y <= north))
        cells.append(cell_key(level, x, y)[there])
        held.append(there)
    return BoxCells(np.concatenate(cells), np.concatenate(held))


def cell_key(level: IntArray, x: IntArray, y: IntArray) -> IntArray:
    """Number cells so that those of one row of one level follow one another."""
    key: IntArray = (level << 40) | (y << 20) | x
    return key


def cell_ranges(box: LatLonBounds) -> Iterator[tuple[int, int]]:
    """Yield the first and last number of every row of cells that touch a box."""
    parts = [(box.west, box.east)]
    if box.west > box.east:
        parts = [(box.west, 180.0), (-180.0, box.east)]
    for level in range(FINEST_LEVEL + 1):
        size_deg = (_UNITS_AROUND >> level) / 1e7
        rows = range(int((box.south + 90.0) // size_deg), int((box.north + 90.0) // size_deg) + 1)
        for west, east in parts:
            first, last = (int((edge + 180.0) // size_deg) for edge in (west, east))
            for y in rows:
                row = (level << 40) | (y << 20)
                yield row | first, row | last


PackedNodes = tuple[bytes, bytes, bytes, str]
"""Ids as int64, latitudes and longitudes as int32, all as differences; tags as OPL, by line."""
PackedWays = tuple[bytes, bytes, bytes, bytes, bytes, str]
"""Ids, counts of nodes, then ids and positions of all nodes and tags, packed as `PackedNodes`."""


class WayTable(msgspec.Struct, frozen=True, dict=True):
    """Ways: ids (W,), how many nodes each has (W,), the nodes one way after the other, and tags
    as OPL."""

    ids: IntArray
    counts: IntArray
    nodes: NodePositions
    tag_texts: Sequence[str]

    @cached_property
    def _begins(self) -> IntArray:
        return np.asarray(np.cumsum(self.counts) - self.counts)

    def boxes(self) -> Boxes:
        """Return the box around each way."""
        edges = ((least, of) for least in (np.minimum, np.maximum) for of in self.nodes[1:])
        return Boxes(*(least.reduceat(of, self._begins) for least, of in edges))

    def rows(self, which: IntArray) -> WayTable:
        """Return chosen ways, in the order of their places in `which`."""
        counts = self.counts[which]
        at = np.repeat(self._begins[which] - np.cumsum(counts) + counts, counts)
        at += np.arange(len(at))
        texts = [self.tag_texts[i] for i in which.tolist()]
        return WayTable(self.ids[which], counts, self.nodes.rows(at), texts)

    def packed(self) -> PackedWays:
        """Return the ways as a cell holds them."""
        counts = self.counts.astype("<i4").tobytes()
        return differences(self.ids, "<i8"), counts, *pack_nodes(self.nodes, self.tag_texts)

    @staticmethod
    def unpacked(body: bytes) -> WayTable:
        """Return the ways of a cell."""
        ids, counts, *nodes, tags = unpack(body, PackedWays)
        each = np.frombuffer(counts, dtype="<i4").astype(np.int64)
        return WayTable(sums(ids, "<i8"), each, _positions(*nodes), tags.split("\n"))


def pack_nodes(nodes: NodePositions, tag_texts: Sequence[str]) -> PackedNodes:
    """Return nodes with their tags, as OPL, as a cell holds them."""
    ids, (lat, lon) = differences(nodes.ids, "<i8"), (differences(of, "<i4") for of in nodes[1:])
    return ids, lat, lon, "\n".join(tag_texts)


def unpack_nodes(body: bytes) -> tuple[NodePositions, list[str]]:
    """Return the nodes of a cell, and their tags as OPL."""
    ids, lat, lon, tags = unpack(body, PackedNodes)
    return _positions(ids, lat, lon), tags.split("\n")


def _positions(ids: bytes, lat: bytes, lon: bytes) -> NodePositions:
    return NodePositions(sums(ids, "<i8"), sums(lat, "<i4"), sums(lon, "<i4"))


def pack(content: PackedWays | PackedNodes | str) -> bytes:
    """Return a cell's objects as they stand on disk."""
    return zlib.compress(msgspec.msgpack.encode(content), 1)


def unpack(data: bytes, kind: Any) -> Any:
    """Return what `pack` packed of a kind: `PackedWays`, `PackedNodes` or str."""
    return msgspec.msgpack.decode(zlib.decompress(data), type=kind)


def differences(values: IntArray, dtype: str) -> bytes:
    """Return numbers as differences, which compress well; they may wrap around."""
    return np.diff(values, prepend=np.int64(0)).astype(dtype).tobytes()


def sums(data: bytes, dtype: str) -> IntArray:
    """Return what `differences` packed, as int64."""
    return np.cumsum(np.frombuffer(data, dtype=dtype), dtype=dtype).astype(np.int64)


def touches(boxes: Boxes, areas: Sequence[LatLonBounds]) -> BoolArray:
    """Return which of the boxes (N,) touch one of the areas."""
    touched: BoolArray = np.zeros(len(boxes.south), dtype=bool)
    for area in areas:
        south, west, north, east = (edge * 1e7 for edge in area)
        in_lon = (boxes.east >= west) & (boxes.west <= east)
        if west > east:
            in_lon = (boxes.east >= west) | (boxes.west <= east)
        touched |= (boxes.north >= south) & (boxes.south <= north) & in_lon
    return touched
