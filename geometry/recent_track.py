"""The last stretch of a track that grows at one end and is forgotten at the other."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from foretwin.contracts.arrays import Array, Stamps

_LEAST_ROWS = 512


class RecentTrack:
    """Rows by rising stamps, whose newest can be had as arrays without being copied.

    To make arrays of a few hundred tuples anew each time costs more than what is done with them.
    """

    def __init__(self, width: int) -> None:
        """`width` numbers stand in each row."""
        self._stamps_ns = np.empty(_LEAST_ROWS, dtype=np.int64)
        self._rows = np.empty((_LEAST_ROWS, width))
        self._first = self._end = 0

    def __len__(self) -> int:
        return self._end - self._first

    @property
    def last_ns(self) -> int | None:
        """The newest stamp, None where nothing is known."""
        return int(self._stamps_ns[self._end - 1]) if len(self) else None

    @property
    def stamps_ns(self) -> Stamps:
        """The stamps (N,), rising, int64; good until the next row is added."""
        return self._stamps_ns[self._first : self._end]

    @property
    def rows(self) -> Array:
        """The rows (N, K); good until the next one is added."""
        return self._rows[self._first : self._end]

    def add(self, stamp_ns: int, row: Sequence[float]) -> None:
        """Add a row; raises ValueError for a stamp that is not after the last."""
        last_ns = self.last_ns
        if last_ns is not None and stamp_ns <= last_ns:
            raise ValueError(f"stamp {stamp_ns} is not after {last_ns}")
        if self._end == len(self._stamps_ns):
            self._make_room()
        self._stamps_ns[self._end] = stamp_ns
        self._rows[self._end] = row
        self._end += 1

    def since(self, stamp_ns: int) -> int:
        """Return the place of the first row at a stamp or after it; their number where none is."""
        return int(self.stamps_ns.searchsorted(stamp_ns))

    def forget(self, count: int) -> None:
        """Forget the `count` oldest rows; none where that is not positive."""
        self._first += min(max(count, 0), len(self))

    def clear(self) -> None:
        """Forget all."""
        self.forget(len(self))

    def _make_room(self) -> None:
        """Move what is known to the front, of a longer table where it fills over half of it."""
        size = len(self._stamps_ns)
        longer = 2 * size if 2 * len(self) > size else size
        stamps_ns, rows = np.empty(longer, np.int64), np.empty((longer, self._rows.shape[1]))
        stamps_ns[: len(self)], rows[: len(self)] = self.stamps_ns, self.rows
        self._stamps_ns, self._rows = stamps_ns, rows
        self._end -= self._first
        self._first = 0
