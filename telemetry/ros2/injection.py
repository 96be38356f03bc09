"""Whether a car on a lot is shown what is virtual, as the run is told: at once on change."""

from __future__ import annotations

from foretwin.contracts.towards_vehicle import GateState, Injection
from foretwin.telemetry.ros2.lot_guard import LotGuard
from foretwin.telemetry.ros2.safety import VehicleGate

EVERY_NS = 200_000_000
"""So often it is said where nothing changes: 5 Hz, and a display is right within a glance."""


class InjectionWord:
    """Remembers what was said last; without a fence nothing is,
    nor before the car's place is known."""

    def __init__(self, gate: VehicleGate, guard: LotGuard | None) -> None:
        self._gate, self._guard = gate, guard
        self._said: GateState | None = None
        self._said_ns = 0

    def news(self, now_ns: int) -> Injection | None:
        """Return what is to be said at a time of the host's monotonic clock, None where nothing."""
        gate = self._gate
        # A reason that flutters while the gate waits is no change to hurry for.
        if gate.state == self._said and now_ns - self._said_ns < EVERY_NS:
            return None
        if self._guard is None or (at := self._guard.standing(now_ns)) is None:
            return None
        self._said, self._said_ns = gate.state, now_ns
        return Injection(gate=gate.state, reason=gate.reason, **at._asdict())
