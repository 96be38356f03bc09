"""Who of a drive's processes died, hangs or grows, and what is missing after it."""

from __future__ import annotations

import contextlib
import datetime
import logging
import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

from foretwin.contracts.certificates import UTC
from foretwin.contracts.errors import UserError
from foretwin.orchestrator.campaign.ending import CertificateEnd
from foretwin.orchestrator.campaign.joining import ends
from foretwin.orchestrator.drive.conductor import Conductor
from foretwin.orchestrator.drive.plan import starts_a_car
from foretwin.orchestrator.drive.processes import ORCHESTRATOR, ROUTER
from foretwin.orchestrator.drive.watcher_setups import VIEWER
from foretwin.orchestrator.instructions import Notice
from foretwin.orchestrator.plan import DrivePlan
from foretwin.orchestrator.runner.supervisor import Death, SupervisedRow

log = logging.getLogger(ORCHESTRATOR)

HUNG_AFTER_S, GIVES_WAY_HUNG_AFTER_S = 1.0, 30.0
"""A process whose token is gone for so long while it runs (a stopped one, say) is killed; one that
gives way may have to wait for a processor that long."""
RECONNECT_S = 2.0
"""So long after our own link came back another process may still be without its own."""
DEATH_TOLD_S = 2.0
"""How long after a silence the supervisor's word of a death may take on a busy machine."""
BACK_WITHIN_S = 15.0
"""Who sent telemetry keeps it for 20 s."""
RECOVERS_S = 1.0
"""What was missed is there so long after it was asked for."""
_LISTEN_S = 0.1
ROUTER_START_S = 15.0
"""What a router that was started again has until it must be there."""


class WatchedProcesses(Protocol):
    """The processes of a drive, whoever started them."""

    def poll(self, now_s: float) -> list[Death]:
        """Return deaths since the last call."""

    def running(self) -> dict[str, int]:
        """Return the processes that have not ended, and the operating system's id of each."""

    def row(self, process_id: str) -> SupervisedRow:
        """Return the table's row of a process."""

    def kill(self, process_id: str) -> None:
        """End a process that hangs."""


@dataclass(slots=True)
class ProcessWatch:
    """Tells of each death once, and ends those that hang; call `look_after` ten times a second."""

    supervisor: WatchedProcesses
    ended_by: str | None = None
    """Whose death ends the drive as an error of ours, in words."""
    vehicle_ended: bool = False
    """Whether no telemetry will come any more: the drive ends with what there is."""
    given_up: set[str] = field(default_factory=set)
    """Processes that are not started any more."""
    troubles: list[str] = field(default_factory=list)
    """Deaths after which something is missing. Of a recorder that is there again the ledger of the
    telemetry tells what."""
    _certificates: CertificateEnd | None = None
    _seen_alive: set[str] = field(default_factory=set)
    _silent_since_s: dict[str, float] = field(default_factory=dict)
    _linked: bool = False
    _link_changed_s: float = -math.inf
    _router_was_there: bool = True
    """Whether there has been a link to the router since it was started last."""

    @property
    def over(self) -> bool:
        """Whether a death ends the drive."""
        return self.vehicle_ended or self.ended_by is not None

    def look_after(self, conductor: Conductor, now_s: float) -> None:
        """Take notice of deaths and of who hangs."""
        for death in self.supervisor.poll(now_s):
            # One that is started again is not silent before it was heard, and the token of the one
            # before it may still be there; or its successor is, already, and counts.
            if conductor.alive.get(death.process_id, death.seen_s) <= death.seen_s:
                conductor.process_down(death.process_id)
            self._seen_alive.discard(death.process_id)
            self._silent_since_s.pop(death.process_id, None)
            if death.process_id == ROUTER:
                self._router_was_there, self._link_changed_s = False, now_s
            text = f"{death.process_id} ended with code {death.exit_code}"
            if death.restarted:
                after = f" in {death.pause_s:g} s" if death.pause_s else ""
                conductor.tell(Notice("warning", f"{text}; started again{after}"))
                if death.process_id == VIEWER:
                    self._missing(f"{text}: what it did not show is missing in monitor.rrd")
                continue
            self.given_up.add(death.process_id)
            conductor.rounds.never_again(death.process_id)
            if death.process_id == ROUTER:
                self._missing(f"{text} and was not started again")
                conductor.tell(Notice("error", text))
                self.ended_by = _router_death(lock_step=conductor.plan.config.lock_step)
            elif death.row.when_dead == "end_drive":
                self._missing(f"{text}: no telemetry comes any more, and the drive ends here")
                conductor.tell(Notice("error", f"{text}: no telemetry comes any more"))
                self.vehicle_ended = True
            else:
                self._missing(f"{text} and was not started again")
                conductor.tell(Notice("error", f"{text}; the drive goes on without it"))
        memory = conductor.context.memory
        for text in memory.look(self.supervisor.running(), now_s):
            conductor.tell(Notice("warning", text))
        conductor.refusals.look(now_s)
        for text in self._certificates_of(conductor.plan).news(datetime.datetime.now(UTC)):
            conductor.tell(Notice("warning", text))
        for text in conductor.tables.take_news():
            conductor.tell(Notice("warning", text))
        self._watch_router(now_s, linked=conductor.bus.connected)
        self._end_the_hung(conductor, now_s)

    def comes_to_an_end(self, conductor: Conductor) -> bool:
        """Wait a moment for the supervisor's word that somebody has died who ends the drive."""
        self._listen(conductor, time.monotonic() + DEATH_TOLD_S, until=lambda: self.over)
        return self.over

    def wait_for(self, process_id: str, conductor: Conductor, *, stop: Callable[[], bool]) -> None:
        """Wait until one that died or hangs is there again and has what it missed.

        It asks who sent it, and they leave with the run. There is no wait for one that is not
        started any more, nor once `stop` says so.
        """

        def settled() -> bool:
            return process_id in conductor.alive or process_id in self.given_up or stop()

        self.look_after(conductor, time.monotonic())
        if settled():
            return
        log.info("the drive ends once %s is there again", process_id)
        deadline_s = time.monotonic() + BACK_WITHIN_S
        self._listen(conductor, deadline_s, until=settled)
        if process_id in conductor.alive:
            recovered_s = min(deadline_s, time.monotonic() + RECOVERS_S)
            self._listen(conductor, recovered_s, until=stop)

    def _listen(
        self, conductor: Conductor, deadline_s: float, *, until: Callable[[], bool]
    ) -> None:
        while not until() and time.monotonic() < deadline_s:
            self.look_after(conductor, time.monotonic())
            conductor.handle(conductor.mailbox.take(_LISTEN_S))

    def _certificates_of(self, plan: DrivePlan) -> CertificateEnd:
        if self._certificates is None:
            secure, last = plan.config.secure, None
            with contextlib.suppress(UserError):  # gone since: no reason to end a drive
                if secure is not None:
                    last = ends(Path(secure), car=starts_a_car(plan.config))
            self._certificates = CertificateEnd(last)
        return self._certificates

    def _missing(self, text: str) -> None:
        if text not in self.troubles:
            self.troubles.append(text)

    def _watch_router(self, now_s: float, *, linked: bool) -> None:
        """Kill a router that runs and that we have no link to; clients find the next one."""
        if linked != self._linked:
            self._linked, self._link_changed_s = linked, now_s
        if linked:
            self._router_was_there = True
            return
        patience_s = HUNG_AFTER_S if self._router_was_there else ROUTER_START_S
        if now_s - self._link_changed_s > patience_s and ROUTER in self.supervisor.running():
            log.warning("%s hangs: killed", ROUTER)
            self.supervisor.kill(ROUTER)
            self._router_was_there, self._link_changed_s = False, now_s

    def _end_the_hung(self, conductor: Conductor, now_s: float) -> None:
        """Kill processes that were alive, run still, and have not answered for a while.

        Without a link to the router nobody is heard, and after it not everybody at once.
        """
        heard_from_s = self._link_changed_s + RECONNECT_S if self._linked else math.inf
        for process_id in self.supervisor.running():
            if process_id in conductor.alive:
                self._silent_since_s.pop(process_id, None)
                self._seen_alive.add(process_id)
            elif process_id in self._seen_alive and now_s >= heard_from_s:
                since_s = self._silent_since_s.setdefault(process_id, now_s)
                row = self.supervisor.row(process_id)
                patience_s = GIVES_WAY_HUNG_AFTER_S if row.nice else HUNG_AFTER_S
                if row.when_dead == "restart" and now_s - since_s > patience_s:
                    log.warning("%s hangs: killed", process_id)
                    self.supervisor.kill(process_id)
                    self._seen_alive.discard(process_id)


def _router_death(*, lock_step: bool) -> str:
    if lock_step:
        return "the router died, and with it what was on its way: in lock step nothing may be lost"
    return "the router died again and again"
