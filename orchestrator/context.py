"""What the parts of a drive share: its plan, the bus below the run's keys, tables, and a voice."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import msgspec

from foretwin.contracts.bus import Bus, Mailbox
from foretwin.orchestrator.instructions import Notice
from foretwin.orchestrator.plan import DrivePlan
from foretwin.orchestrator.record.results import ResultTables
from foretwin.orchestrator.runner.memory import MemoryWatch


@dataclass(frozen=True, slots=True)
class DriveContext:
    """One drive; `mailbox` takes what comes from the bus, `tell` informs the engineer."""

    plan: DrivePlan
    bus: Bus
    mailbox: Mailbox
    tables: ResultTables
    tell: Callable[[Notice], None]
    memory: MemoryWatch = field(default_factory=MemoryWatch)

    def publish(self, channel: str, message: msgspec.Struct) -> None:
        """Send a message below the run's key."""
        self.bus.publish(channel, message, run=self.plan.run_id)

    def subscribe(self, *channels: str) -> None:
        """Let messages below the run's key land in the mailbox."""
        for channel in channels:
            self.bus.subscribe(channel, self.mailbox, run=self.plan.run_id)

    def request(
        self, process: str, channel: str, message: msgspec.Struct, *, timeout_s: float, tag: Any
    ) -> None:
        """Ask a process of the run; exactly one Reply with `tag` lands in the mailbox."""
        ids = {"run": self.plan.run_id, "process": process}
        self.bus.request(channel, message, self.mailbox, tag=tag, timeout_s=timeout_s, **ids)
