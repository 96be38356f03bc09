"""Python's search for garbage, while maps are read and Worlds are built."""

from __future__ import annotations

import contextlib
import gc
import threading
from collections.abc import Iterator

COLLECT_AFTER = 200_000
"""Maps and Worlds are a million objects that stay: the collector need not look after every 700."""
_CHANGING = threading.Lock()
_found: list[tuple[int, int, int]] = []
"""What each found who is at it, in whatever thread: what the first found counts."""


@contextlib.contextmanager
def rarely_collected() -> Iterator[None]:
    """Let garbage be looked for rarely, and as often as before once nobody needs that any more."""
    with _CHANGING:
        usual = gc.get_threshold()
        _found.append(_found[0] if _found else usual)
        gc.set_threshold(max(COLLECT_AFTER, usual[0]) if usual[0] else 0, *usual[1:])
    try:
        yield
    finally:
        with _CHANGING:
            before = _found.pop()
            if not _found:
                gc.set_threshold(*before)
