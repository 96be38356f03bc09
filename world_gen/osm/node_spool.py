"""Positions of nodes on disk, looked up for many nodes at once, in bounded memory."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from foretwin.world_gen.osm.map_assembly import sorted_positions
from foretwin.world_gen.osm.opl import NodePositions
from foretwin.world_gen.osm.osm_map import IntArray

RECORD = np.dtype([("id", "<i8"), ("lat", "<i4"), ("lon", "<i4")])
WINDOW = 1 << 18
"""Records looked at in one go: 4 MiB."""
BUCKET = 1 << 21
"""Records sorted in one go where the file is in no order."""


class NodeSpool:
    """First `add` everything, then `finish`, then `find`."""

    def __init__(self, folder: Path) -> None:
        self._path = folder / "nodes.bin"
        self._sorted_path = folder / "sorted.bin"
        self._file = self._path.open("wb")
        self._last: int | None = None
        self._ascending = True
        self._sample: list[IntArray] = []
        self._firsts: IntArray = np.empty(0, dtype=np.int64)
        self._lasts: IntArray = np.empty(0, dtype=np.int64)
        self.count = 0
        self.notes: list[str] = []

    def add(self, positions: NodePositions) -> None:
        """Append nodes in the order of the file."""
        ids = positions.ids
        if not len(ids):
            return
        self._file.write(_records(positions))
        self._ascending &= bool((ids[1:] > ids[:-1]).all())
        self._ascending &= self._last is None or self._last < int(ids[0])
        self._last = int(ids[-1])
        self._sample.append(ids[::1024].copy())
        self.count += len(ids)

    def close(self) -> None:
        """Close the file; nothing more is added."""
        self._file.close()

    def finish(self) -> None:
        """Bring the nodes into ascending order, each once; the last of several is kept."""
        self.close()
        if not self._ascending:
            self._sort()
        firsts, lasts = [], []
        with self._path.open("rb") as file:
            while len(records := np.fromfile(file, dtype=RECORD, count=WINDOW)):
                firsts.append(records["id"][0])
                lasts.append(records["id"][-1])
        self._firsts = np.array(firsts, dtype=np.int64)
        self._lasts = np.array(lasts, dtype=np.int64)

    def _sort(self) -> None:
        """Part the nodes by ranges of ids into files that fit into memory, and sort each."""
        sample = np.sort(np.concatenate(self._sample))
        buckets = self.count // BUCKET + 1
        limits = np.unique(sample[np.linspace(0, len(sample) - 1, buckets + 1).astype(int)[1:-1]])
        paths = [self._path.with_name(f"bucket{i}.bin") for i in range(len(limits) + 1)]
        with self._path.open("rb") as file:
            while len(records := np.fromfile(file, dtype=RECORD, count=BUCKET)):
                of = np.searchsorted(limits, records["id"], side="right")
                for i in np.unique(of).tolist():
                    with paths[i].open("ab") as bucket:
                        bucket.write(records[of == i].tobytes())
        with self._sorted_path.open("wb") as target:
            for path in paths:
                if path.exists():
                    records = np.fromfile(path, dtype=RECORD)
                    path.unlink()
                    target.write(_records(sorted_positions([_positions(records)], self.notes)))
        self._sorted_path.replace(self._path)

    def find(self, nodes: IntArray) -> NodePositions:
        """Return those of `nodes` (N,) that are known and on the Earth, ascending, each once."""
        wanted = _distinct(nodes)
        begins = np.searchsorted(wanted, self._firsts)
        ends = np.searchsorted(wanted, self._lasts, side="right")
        chunks = []
        with self._path.open("rb") as file:
            for window in np.flatnonzero(ends > begins).tolist():
                file.seek(window * WINDOW * RECORD.itemsize)
                records = np.fromfile(file, dtype=RECORD, count=WINDOW)
                part = wanted[begins[window] : ends[window]]
                ids = records["id"].copy()
                rows = np.searchsorted(ids, part)
                chunks.append(_positions(records[rows[ids[rows] == part]]))
        return sorted_positions(chunks, self.notes)


def _records(positions: NodePositions) -> bytes:
    return np.rec.fromarrays(positions, dtype=RECORD).tobytes()


def _positions(records: np.ndarray) -> NodePositions:
    return NodePositions(*(records[name].astype(np.int64) for name in ("id", "lat", "lon")))


def _distinct(values: IntArray) -> IntArray:
    """Return the values ascending, each once; sorting is quicker here than numpy's hashing."""
    ordered = np.sort(values)
    distinct: IntArray = ordered[np.append(True, ordered[1:] != ordered[:-1])[: len(ordered)]]
    return distinct
