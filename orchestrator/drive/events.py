"""What is worth telling the engineer: logged, published, kept, and shown as it happens."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass

from foretwin.contracts.bus import Bus
from foretwin.contracts.simulation import Event
from foretwin.orchestrator.drive.processes import ORCHESTRATOR
from foretwin.orchestrator.instructions import Notice
from foretwin.orchestrator.record.results import ResultTables
from foretwin.sim_worker.futures.columns import row_of

log = logging.getLogger(ORCHESTRATOR)

_LEVELS = {"info": logging.INFO, "warning": logging.WARNING, "error": logging.ERROR}


@dataclass(slots=True)
class EventHandler:
    """Tells the orchestrator's own events, and keeps those of all processes."""

    bus: Bus
    tables: ResultTables
    run_id: str
    now_stamp_ns: Callable[[], int]
    on_event: Callable[[Event], None] | None = None

    def tell(self, tell: Notice) -> None:
        """Log an event, publish it, and keep it."""
        event = Event(
            stamp_ns=self.now_stamp_ns(), level=tell.level, source=ORCHESTRATOR, text=tell.text
        )
        self.bus.publish("event", event, run=self.run_id)
        self._keep(event)

    def heard(self, event: Event) -> None:
        """Keep an event from the bus, where our own come back too."""
        if event.source != ORCHESTRATOR:
            self._keep(event)

    def _keep(self, event: Event) -> None:
        log.log(_LEVELS[event.level], "%s: %s", event.source, event.text)
        if self.on_event is not None:
            self.on_event(event)
        self.tables.add("events", [row_of(event)])
