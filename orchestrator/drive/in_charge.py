"""The orchestrator's word towards a real vehicle: said from the loop itself, never beside it."""

from __future__ import annotations

import time
from collections.abc import Callable

from foretwin.contracts.bus import Bus
from foretwin.contracts.towards_vehicle import Authority
from foretwin.orchestrator.plan import DrivePlan

EVERY_NS = 20_000_000


class InCharge:
    """Says that the orchestrator is in charge; raises ValueError unless both switches are on.

    No thread says it: a loop that hangs must fall silent, so that the gateway shuts.
    """

    def __init__(
        self, bus: Bus, plan: DrivePlan, *, mono_ns: Callable[[], int] = time.monotonic_ns
    ) -> None:
        if not plan.towards_vehicle:
            raise ValueError("nothing may go towards the vehicle: a switch is off")
        self._bus, self._run_id, self._mono_ns = bus, plan.run_id, mono_ns
        self._said_ns: int | None = None

    def say(self) -> None:
        """Say it, 50 times a second at most."""
        now_ns = self._mono_ns()
        if self._said_ns is None or now_ns - self._said_ns >= EVERY_NS:
            self._said_ns = now_ns
            self._bus.publish("authority", Authority(sent_mono_ns=now_ns), run=self._run_id)
