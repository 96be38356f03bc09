"""Lights of a drive: said to all who drive by them, and to the futures of each round."""

from __future__ import annotations

from foretwin.contracts.drive import SignalState, VehicleState
from foretwin.contracts.world import World
from foretwin.orchestrator.context import DriveContext
from foretwin.orchestrator.drive.intake import Intake
from foretwin.orchestrator.instructions import LatestReports
from foretwin.orchestrator.runtime_configuration.lights import LightHandler, LightsInForce

SAID_EVERY_NS = 100_000_000
"""Of the vehicle's clock; a change by hand is said at once."""


class LightLink:
    """Says what lights show, and lets those set by hand count in futures."""

    def __init__(self, context: DriveContext, intake: Intake) -> None:
        self._context, self._intake = context, intake
        self.in_force = LightsInForce()
        self.handler = LightHandler(self.in_force)
        self._said_ns: int | None = None

    def use_world(self, world: World | None) -> None:
        """Tell of this World's lights."""
        self.in_force.use_world(world)
        self.say()

    def keep_up_with(self, state: VehicleState) -> None:
        """Say what lights show, where that was not done lately."""
        if self._said_ns is None or abs(state.stamp_ns - self._said_ns) >= SAID_EVERY_NS:
            self.say()

    def say(self) -> None:
        """Say what lights show now."""
        intake = self._intake
        self._said_ns = stamp_ns = intake.now_stamp_ns
        signals = intake.signals
        shown = self.in_force.shown(
            stamp_ns, intake.start_stamp_ns, signals.heard, signals.learnt(stamp_ns)
        )
        self._context.publish("lights", shown)

    def among(self, reports: LatestReports) -> LatestReports:
        """Return what a round is told, with the lights that were set by hand as if they were heard
        now; what was learnt of them does not count."""
        chosen = self.in_force.set
        if not chosen:
            return reports
        now_ns = self._intake.now_stamp_ns
        return reports._replace(
            signals=(
                *(one for one in reports.signals if one.group_id not in chosen),
                *(
                    SignalState(stamp_ns=now_ns, group_id=group, colour=colour)
                    for group, colour in sorted(chosen.items())
                ),
            ),
            learnt_signals=tuple(
                one for one in reports.learnt_signals if one.group_id not in chosen
            ),
        )
