"""What is worth telling the engineer: logged, published, kept, and shown as it happens."""

from __future__ import annotations

import logging
from collections.abc import Callable

from foretwin.contracts.bus import Bus
from foretwin.contracts.simulation import Event
from foretwin.orchestrator.drive.processes import ORCHESTRATOR
from foretwin.orchestrator.instructions import Tell
from foretwin.orchestrator.record.columns import row_of
from foretwin.orchestrator.record.results import ResultTables

log = logging.getLogger(ORCHESTRATOR)

_LEVELS = {"info": logging.INFO, "warning": logging.WARNING, "error": logging.ERROR}


class EventHandler:
    """Tells the orchestrator's own events, and keeps those of all processes."""

    def __init__(
        self, bus: Bus, tables: ResultTables, *, run_id: str, now_stamp_ns: Callable[[], int]
    ) -> None:
        self.on_event: Callable[[Event], None] | None = None
        self._bus = bus
        self._tables = tables
        self._run_id = run_id
        self._now_stamp_ns = now_stamp_ns

    def tell(self, tell: Tell) -> None:
        """Log an event, publish it, and keep it."""
        event = Event(
            stamp_ns=self._now_stamp_ns(), level=tell.level, source=ORCHESTRATOR, text=tell.text
        )
        self._bus.publish("event", event, run=self._run_id)
        self._keep(event)

    def heard(self, event: Event) -> None:
        """Keep an event from the bus, where our own come back too."""
        if event.source != ORCHESTRATOR:
            self._keep(event)

    def _keep(self, event: Event) -> None:
        log.log(_LEVELS[event.level], "%s: %s", event.source, event.text)
        if self.on_event is not None:
            self.on_event(event)
        self._tables.add("events", [row_of(event)])
