"""Python's search for garbage, while maps are read and Worlds are built."""

from __future__ import annotations

import contextlib
import gc
from collections.abc import Iterator

COLLECT_AFTER = 200_000
"""Maps and Worlds are a million objects that stay: the collector need not look after every 700."""


@contextlib.contextmanager
def rarely_collected() -> Iterator[None]:
    """Let garbage be looked for rarely, and after it as often as before."""
    before = gc.get_threshold()
    gc.set_threshold(max(COLLECT_AFTER, before[0]) if before[0] else 0, *before[1:])
    try:
        yield
    finally:
        gc.set_threshold(*before)
