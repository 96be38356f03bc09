"""The vehicle's last word where it was said while nobody here could hear it."""

from __future__ import annotations

from foretwin.contracts.bus import Bus, Mailbox
from foretwin.orchestrator.drive.intake import Intake

SILENT_S, AGAIN_S = 2.0, 2.0
"""How long nothing must have come before it is asked for, and then every so often."""
_OLD_NS = 1_000_000_000


class MissedEnd:
    """Asks for a kept `end` as long as no telemetry comes; call `look` ten times a second.

    An orchestrator that stood still, was cut off or began after another one has not heard it, and
    a live drive would go on for ever. At the start of a drive nobody asks: what a vehicle keeps
    from then is the end of another drive.
    """

    def __init__(self, bus: Bus, mailbox: Mailbox, vehicle_id: str, *, begun: bool) -> None:
        """`begun` says that the drive goes on from another orchestrator."""
        self._bus, self._mailbox, self._vehicle_id = bus, mailbox, vehicle_id
        self._begun = begun
        self._asked = False
        self._states = 0
        self._due_s: float | None = None

    def look(self, intake: Intake, now_s: float) -> None:
        """Ask where it is time to, and let the end of another drive be none of this one's."""
        if intake.states != self._states or self._due_s is None:
            self._begun = self._begun or intake.states > 0
            self._states, self._due_s = intake.states, now_s + SILENT_S
        elif self._begun and now_s >= self._due_s:
            self._due_s = now_s + AGAIN_S
            self._ask()
        if self._asked and intake.end is not None and intake.latest is not None:
            is_old = intake.end.stamp_ns < intake.latest.state.stamp_ns - _OLD_NS
            intake.end = None if is_old else intake.end

    def _ask(self) -> None:
        if self._asked:
            self._bus.recover("end", vehicle=self._vehicle_id)
        else:
            self._asked = True
            self._bus.subscribe("end", self._mailbox, recover=True, vehicle=self._vehicle_id)
