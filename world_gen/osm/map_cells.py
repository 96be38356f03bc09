"""The cells of a map index: which cell holds what, and how a cell's objects are packed."""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Sequence
from typing import NamedTuple, TypeVar

import msgspec
import numpy as np

from foretwin.world_gen.osm.map_assembly import BoolArray
from foretwin.world_gen.osm.opl import IntArray
from foretwin.world_gen.osm.osm_map import LatLonBounds

FINEST_LEVEL = 13
"""360 degrees halved this often: cells of 0.044 degrees, some 5 by 3 km in Germany."""
_UNITS_AROUND = 3_600_000_000


class Boxes(NamedTuple):
    """South, west, north and east edges (N,) each, in units of 1e-7 degrees."""

    south: IntArray
    west: IntArray
    north: IntArray
    east: IntArray


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


class CellWays(msgspec.Struct, frozen=True, array_like=True):
    """Ways of one cell: int64 ids and node ids and int32 positions as differences, tags as OPL."""

    ids: bytes
    counts: bytes
    nodes: bytes
    lat: bytes
    lon: bytes
    tags: str


class CellNodes(msgspec.Struct, frozen=True, array_like=True):
    """Tagged nodes of one cell, packed as in `CellWays`."""

    ids: bytes
    lat: bytes
    lon: bytes
    tags: str


Content = TypeVar("Content", CellWays, CellNodes, str)


def pack(content: CellWays | CellNodes | str) -> bytes:
    """Return a cell's objects as they stand on disk."""
    return zlib.compress(msgspec.msgpack.encode(content), 1)


def unpack(data: bytes, kind: type[Content]) -> Content:
    """Return what `pack` packed."""
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
