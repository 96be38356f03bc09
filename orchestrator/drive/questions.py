"""What the orchestrator asks other processes during a drive, and how much is still unanswered."""

from __future__ import annotations

from collections.abc import Collection

import msgspec

from foretwin.contracts.bus import Bus, Mailbox

ANSWER_TIMEOUT_S = 10.0


class Questions:
    """Asks processes that are alive; answers land in the mailbox."""

    def __init__(self, bus: Bus, mailbox: Mailbox, *, run_id: str, alive: Collection[str]) -> None:
        self.unanswered = 0
        """In lock step nothing goes on before all are answered."""
        self._bus, self._mailbox, self._run_id, self._alive = bus, mailbox, run_id, alive

    def ask(self, process_id: str, channel: str, message: msgspec.Struct) -> None:
        """Ask a process, where it is alive."""
        if process_id not in self._alive:
            return
        self.unanswered += 1
        self._bus.request(
            channel, message, self._mailbox, timeout_s=ANSWER_TIMEOUT_S, run=self._run_id,
            process=process_id,
        )  # fmt: skip

    def answered(self) -> None:
        """Count an answer."""
        self.unanswered -= 1
