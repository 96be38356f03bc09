"""Where nodes are: a mapping for single look-ups, arrays for many at once."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import numpy.typing as npt

from foretwin.contracts.arrays import Array


class NodeLocations(Mapping[int, tuple[float, float]]):
    """(lat, lon) in degrees by node id, kept as arrays: ids (N,) ascending, positions (N, 2)."""

    def __init__(self, ids: npt.NDArray[np.int64], lat_lon_deg: Array) -> None:
        self.ids = ids
        self.lat_lon_deg = lat_lon_deg
        self._by_id: dict[int, tuple[float, float]] | None = None

    def of(self, nodes: npt.NDArray[np.int64] | Sequence[int]) -> Array:
        """Return (M, 2) degrees of `nodes` (M,); KeyError names one that is not there."""
        wanted = np.asarray(nodes, dtype=np.int64)
        if not len(self.ids):
            if len(wanted):
                raise KeyError(int(wanted[0]))
            return np.empty((0, 2))
        rows = np.minimum(np.searchsorted(self.ids, wanted), len(self.ids) - 1)
        absent = self.ids[rows] != wanted
        if absent.any():
            raise KeyError(int(wanted[absent][0]))
        found: Array = self.lat_lon_deg[rows]
        return found

    def _table(self) -> dict[int, tuple[float, float]]:
        if self._by_id is None:
            # Most uses of a map never ask for a single node; only the first that does pays.
            pairs = zip(
                self.lat_lon_deg[:, 0].tolist(), self.lat_lon_deg[:, 1].tolist(), strict=True
            )
            self._by_id = dict(zip(self.ids.tolist(), pairs, strict=True))
        return self._by_id

    def __getitem__(self, node: int) -> tuple[float, float]:
        return self._table()[node]

    def __contains__(self, node: object) -> bool:
        return node in self._table()

    def __iter__(self) -> Iterator[int]:
        return iter(self.ids.tolist())

    def __len__(self) -> int:
        return len(self.ids)
