"""What the orchestrator asks other processes during a drive, and how much is still unanswered."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import msgspec

from foretwin.orchestrator.context import DriveContext

ANSWER_TIMEOUT_S = 10.0
ASKED_OF_SIMULATIONS = "use_world", "use_roles", "use_course"
"""Of the mirror and of virtual traffic: the answer says that it counts."""


@dataclass(slots=True)
class Questions:
    """Asks processes that are alive; answers land in the mailbox."""

    context: DriveContext
    alive: Collection[str]
    unanswered: int = 0
    """In lock step nothing goes on before all are answered."""

    def ask(self, process_id: str, channel: str, message: msgspec.Struct) -> None:
        """Ask a process, where it is alive."""
        if process_id in self.alive:
            self.unanswered += 1
            self.context.request(process_id, channel, message, timeout_s=ANSWER_TIMEOUT_S, tag=None)

    def answered(self) -> None:
        """Count an answer."""
        self.unanswered -= 1
