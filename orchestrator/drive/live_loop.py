"""The live loop: telemetry comes when it comes, rounds start by the wall clock, nothing waits."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

from foretwin.contracts.bus import Received
from foretwin.contracts.keys import TELEMETRY_CHANNELS
from foretwin.orchestrator.drive.conductor import Conductor
from foretwin.orchestrator.rounds.runner import ROUND_DEADLINE_S

HOUSEKEEPING_S = 0.1
SILENCE_S = 0.05
"""So long may nothing come before it is asked whether something should have."""
LAST_ROUND_GRACE_S = 1.0
STALE_AFTER_S = 1.0
"""No round starts from a state older than this, in seconds of the drive's clock."""


@dataclass(slots=True)
class LiveLoop:
    """Runs a conductor until the vehicle's drive ends or `stop` says so.

    A round falls due `rate_hz` times a wall second. It starts with the first state received from
    then on, so that a slow GNSS does not make results older than need be, and at the latest half
    a period later. A round that is not complete when the next one should start has missed its
    deadline: it counts as missed, is let finish, and the next one is left out. `round_pace`
    then makes the rounds after it smaller or rarer, so that a slow machine gives less, not late.
    """

    conductor: Conductor
    housekeeping: Callable[[float], None]
    stop: Callable[[], bool]
    each_turn: Callable[[], None] = lambda: None
    """Called at least every 50 ms, unless the loop itself is held up."""
    _started_s: float = 0.0

    @property
    def _period_s(self) -> float:
        return 1.0 / self.conductor.plan.config.rate_hz

    def run(self) -> bool:
        """Return True where the drive ended by itself, False where it was stopped."""
        conductor = self.conductor
        next_due_s = time.monotonic()
        next_housekeeping_s = next_due_s
        while not self.stop():
            self.each_turn()
            conductor.make_changes()
            now_s = time.monotonic()
            if now_s >= next_housekeeping_s:
                self.housekeeping(now_s)
                next_housekeeping_s = now_s + HOUSEKEEPING_S
            seen = conductor.intake.states
            wake_s = min(next_housekeeping_s, next_due_s + 0.5 * self._period_s, now_s + SILENCE_S)
            item = conductor.mailbox.take(max(0.0, wake_s - now_s))
            now_s = time.monotonic()
            if item is not None:
                conductor.handle(item)
                now_s = time.monotonic()
            else:
                conductor.watch_telemetry(round(now_s * 1e9))
            fresh = conductor.intake.states > seen
            due = fresh or now_s >= next_due_s + 0.5 * self._period_s
            # New parameters take workers a few milliseconds; no round may be half of one kind.
            if now_s >= next_due_s and due and conductor.tuning.parameters.settled:
                # A machine that was asleep does not catch up on rounds; the grid stays.
                one_of = conductor.rounds.pace.now.one_of
                left_out = int((now_s - next_due_s) / (one_of * self._period_s))
                next_due_s += (left_out + 1) * one_of * self._period_s
                if self._start_round(now_s):
                    conductor.missed_rounds += left_out
                    conductor.spared_rounds += one_of - 1
            if conductor.intake.end is not None and not self._telemetry_waits():
                self._let_finish()
                return True
        return False

    def _start_round(self, now_s: float) -> bool:
        """Start a round if one can be; returns whether rounds are due here at all."""
        conductor = self.conductor
        latest = conductor.intake.latest
        if latest is None:
            return False
        speed = conductor.plan.config.speed or 1.0
        if (now_s - latest.receipt_mono_ns / 1e9) * speed > STALE_AFTER_S:
            return False
        if conductor.rounds.open:
            conductor.missed_rounds += 1
            if now_s - self._started_s > ROUND_DEADLINE_S:
                conductor.rounds.drop()
            return True
        # Where the machine is too slow, one round follows the other without a turn between.
        conductor.make_changes()
        if not (conductor.tuning.parameters.settled and conductor.start_round()):
            return False
        self._started_s = now_s
        return True

    def _telemetry_waits(self) -> bool:
        return len(self.conductor.mailbox) > 0

    def _let_finish(self) -> None:
        """Give the last round its time and take what the mirror still has to say."""
        conductor = self.conductor
        deadline = time.monotonic() + LAST_ROUND_GRACE_S
        while time.monotonic() < deadline and conductor.rounds.open:
            item = conductor.mailbox.take(0.05)
            if item is not None:
                conductor.handle(item)


def is_telemetry(item: object) -> bool:
    """Whether a mailbox item is a sample from the vehicle."""
    return isinstance(item, Received) and item.channel in TELEMETRY_CHANNELS
