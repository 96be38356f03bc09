"""What came from outside and cannot be used: told once of each kind, counted for run.json."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal

from foretwin.contracts.guard import Refused
from foretwin.contracts.refusals import Refusals
from foretwin.orchestrator.instructions import Notice


class RefusalHandler:
    """Counts refusals of one drive by sender and reason, and tells the first of each."""

    def __init__(self, tell: Callable[[Notice], None]) -> None:
        self._tell = tell
        self.counted = Refusals()

    def take(self, refused: Refused) -> None:
        """Count something that was not let in."""
        self._say("error", self.counted.take(refused))

    def leave_out(self, key: str, count: int) -> None:
        """Count road users that were left out of a message on `key`."""
        self._say("warning", self.counted.note(key, "road users that cannot be", count=count))

    def record(self) -> dict[str, Any]:
        """Return the `refused` of run.json."""
        return self.counted.record()

    def _say(self, level: Literal["warning", "error"], text: str | None) -> None:
        if text is not None:
            self._tell(Notice(level, text))
