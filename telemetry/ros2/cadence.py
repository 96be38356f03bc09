"""How often something is done at most."""

from __future__ import annotations

from collections.abc import Callable


class Cadence:
    """Remembers when what was done last; `mono_ns` is the host's monotonic clock."""

    def __init__(self, mono_ns: Callable[[], int]) -> None:
        self._mono_ns = mono_ns
        self._last_ns: dict[str, int] = {}

    def due(self, what: str, every_ns: int) -> bool:
        """Whether `what` is due now, which then counts as done; the first time always."""
        now_ns = self._mono_ns()
        if now_ns - self._last_ns.get(what, now_ns - every_ns) < every_ns:
            return False
        self._last_ns[what] = now_ns
        return True
