"""Who says that it belongs to a run without having been started by it: it is counted, and gets
nothing."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from foretwin.contracts.local_bus import CAR_OF
from foretwin.orchestrator.instructions import Notice


@dataclass(slots=True)
class Strangers:
    """Tells the processes of a run, by their ids, from others."""

    expected: frozenset[str]
    tell: Callable[[Notice], None]
    count: int = 0
    """How often somebody came up whom nobody expected."""

    def refuse(self, process_id: str, *, up: bool) -> bool:
        """Return whether a process is none of the run's; tells of the first that comes up."""
        if process_id in self.expected:
            return False
        if process_id.startswith(CAR_OF):  # speaks for a vehicle, and wants no work
            return True
        if up and not self.count:
            text = f"{process_id!a} says that it belongs to this run, which did not start it"
            self.tell(Notice("warning", f"{text}: it gets no work"))
        self.count += up
        return True
