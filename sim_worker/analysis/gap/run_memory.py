"""Free runs that need not be made again: stretches overlap by most of their length."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from foretwin.contracts.arrays import Array

Rows = np.ndarray[Any, np.dtype[np.intp]]
Stamps = np.ndarray[Any, np.dtype[np.int64]]
Flags = np.ndarray[Any, np.dtype[np.bool_]]


class RunMemory:
    """Keeps the runs of one vehicle's model by when and how they began.

    Belongs to one FreeRunner; what is kept is no older than the stretch asked for last.
    """

    def __init__(self) -> None:
        self._known: dict[tuple[int, bool], Array] = {}

    def states(
        self,
        *,
        stamp_ns: Stamps,
        held: Flags,
        settled: Flags,
        from_stamp_ns: int,
        run: Callable[[Rows], Array],
    ) -> Array:
        """Return the states (K, steps + 1, 8) of K runs that began at `stamp_ns`, in both kinds.

        `run` makes those that are not known, by their rows. A run is kept once it is `settled`:
        until then samples may come that belong into it. Older ones than `from_stamp_ns` are
        forgotten.
        """
        keys = list(zip(stamp_ns.tolist(), held.tolist(), strict=True))
        missing = np.array([row for row, key in enumerate(keys) if key not in self._known], np.intp)
        fresh = dict(zip(missing.tolist(), run(missing), strict=True)) if len(missing) else {}
        states = np.stack(
            [fresh[row] if row in fresh else self._known[key] for row, key in enumerate(keys)]
        )
        self._known = {key: kept for key, kept in self._known.items() if key[0] >= from_stamp_ns}
        self._known |= {keys[row]: made for row, made in fresh.items() if settled[row]}
        return states
