"""The live loop: telemetry comes when it comes, rounds start by the wall clock, nothing waits."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

from foretwin.contracts.bus import Received
from foretwin.contracts.keys import TELEMETRY_CHANNELS
from foretwin.contracts.too_old import STALE_S
from foretwin.contracts.trace import item_name, span
from foretwin.orchestrator.drive.conductor import Conductor
from foretwin.orchestrator.drive.missed_end import MissedEnd
from foretwin.telemetry.estimator.estimator import STATE_PERIOD_NS

HOUSEKEEPING_S = 0.1
SILENCE_S = 0.05
"""So long may nothing come, beyond a portion, before it is asked whether something should have; so
long at most is a portion worked at before anything else gets its turn."""
LAST_ROUND_GRACE_S = 1.0
GATHER_S = 0.1
"""Samples are taken in portions: to wake up for each of 330 a second, with nothing in the
processor's caches, costs more than what most of them are about. Neither an answer nor a round that
is due waits."""
_BEFORE_STATE_S = 0.002
"""Where something goes back to the car, so long before the next state is due nothing is gathered
any more: what the car is shown is as old as the state that it is of."""
UNPLACED_S = 5.0
"""So long after a restart nothing falls due before it is known where the car is; then it does where
it did before."""


class RoundGrid(NamedTuple):
    """When the next round is due, by the monotonic clock, and whether rounds are wanted."""

    next_due_s: float
    wanted: bool


@dataclass(slots=True)
class LiveLoop:
    """Runs a conductor until the vehicle's drive ends or `stop` says so.

    A round falls due `rate_hz` times a wall second where the mission wants rounds. It starts with
    the newest state as soon as one comes from then on, so that a slow GNSS does not make results
    older than need be, and at the latest half a period later. So long it waits for the round
    before, too, which may have begun late itself: what is not complete then is let finish, and the
    one that waited is missed.
    `pace` then makes the rounds after it smaller or rarer, so that a slow machine gives less, not
    late. What fell due while nothing of this ran (the machine slept, we were behind) is missed.
    """

    conductor: Conductor
    housekeeping: Callable[[float], None]
    stop: Callable[[], bool]
    each_turn: Callable[[], None] = lambda: None
    """Called at least every 100 ms, and every 50 ms where something goes back to the car, unless
    the loop itself is held up."""
    before: RoundGrid | None = None
    """The grid of an orchestrator before this one: what fell due since is missed."""
    _next_due_s: float = 0.0
    _unplaced_until_s: float = 0.0

    @property
    def grid(self) -> RoundGrid:
        """Where the rounds are, for who goes on with them."""
        wanted = self.conductor.mission.wants_rounds
        if self._is_unplaced(time.monotonic()) and self.before is not None:
            wanted = self.before.wanted
        return RoundGrid(self._next_due_s, wanted)

    @property
    def _period_s(self) -> float:
        return 1.0 / self.conductor.plan.config.rate_hz

    def run(self) -> bool:
        """Return True where the drive ended by itself, False where it was stopped."""
        conductor = self.conductor
        vehicle_id, begun = conductor.plan.config.vehicle_id, self.before is not None
        missed_end = MissedEnd(conductor.bus, conductor.mailbox, vehicle_id, begun=begun)
        next_housekeeping_s = self._next_due_s = time.monotonic()
        if self.before is not None:
            self._next_due_s = self.before.next_due_s
            self._unplaced_until_s = next_housekeeping_s + UNPLACED_S
        while not self.stop():
            self.each_turn()
            conductor.make_changes()
            now_s = time.monotonic()
            if now_s >= next_housekeeping_s:
                with span("housekeeping"):
                    self.housekeeping(now_s)
                next_housekeeping_s = now_s + HOUSEKEEPING_S
            if not self._telemetry_waits():
                starts_s = self._at_the_latest_s if conductor.rounds.open else self._next_due_s
                until_s = min(self._gather_until(now_s), starts_s, next_housekeeping_s)
                conductor.mailbox.gather(max(0.0, until_s - now_s))
            gathered_s = time.monotonic()
            # What should have started, and may not, waits for what comes.
            latest_s = self._at_the_latest_s if self._at_the_latest_s > now_s else math.inf
            wake_s = min(next_housekeeping_s, latest_s, now_s + SILENCE_S)
            until_s = min(latest_s, gathered_s + SILENCE_S)
            item = conductor.mailbox.take(max(0.0, wake_s - gathered_s))
            if item is None:
                now_s = time.monotonic()
                conductor.watch_telemetry(round(now_s * 1e9))
            while item is not None:
                with span(item_name(item)):
                    conductor.handle(item)
                now_s = time.monotonic()
                # Only samples go without a turn in between: nothing that it looks at hangs on them.
                if now_s >= until_s or not is_telemetry(item) or not self._telemetry_waits():
                    break
                item = conductor.mailbox.take()
            due = now_s >= self._next_due_s and not self._is_unplaced(now_s)
            missed_end.look(conductor.intake, now_s)
            ended = conductor.intake.end is not None and not self._telemetry_waits()
            if due and not ended and self._begins(now_s):
                # Where the machine is too slow, one round follows the other without a turn between.
                conductor.make_changes()
                # New parameters take workers a few milliseconds; no round may be half of one kind.
                if conductor.tuning.parameters.settled and self._fall_due(now_s):
                    self._start_round(now_s)
            if ended:
                self._leave_out(now_s)
                self._let_finish()
                return True
        self._leave_out(time.monotonic())
        return False

    def _gather_until(self, now_s: float) -> float:
        """Return until when samples are gathered: for a car that is shown things, to no state."""
        if not self.conductor.plan.towards_vehicle:
            return now_s + GATHER_S
        latest = self.conductor.intake.latest
        if latest is None:
            return now_s
        return (latest.receipt_mono_ns + STATE_PERIOD_NS) * 1e-9 - _BEFORE_STATE_S

    @property
    def _at_the_latest_s(self) -> float:
        """When the next round starts if no fresh state comes before."""
        return self._next_due_s + 0.5 * self._period_s

    @property
    def _is_fresh(self) -> bool:
        """Whether the newest state came after the next round fell due, in no portion before."""
        latest = self.conductor.intake.latest
        return latest is not None and latest.receipt_mono_ns * 1e-9 >= self._next_due_s

    def _begins(self, now_s: float) -> bool:
        """Whether what is due starts now, or is missed: it waits for nothing any more."""
        late = now_s >= self._at_the_latest_s
        # Of a portion the newest state counts.
        if not late and (not self._is_fresh or self._telemetry_waits()):
            return False
        rounds = self.conductor.rounds
        if rounds.open:
            rounds.next_is_due()
        return late or not rounds.open

    def _fall_due(self, now_s: float) -> bool:
        """Count the rounds due by now; returns whether one of them can be run.

        All but the last are left out: a machine that was asleep does not catch up. The grid stays.
        """
        one_of = self.conductor.rounds.pace.now.one_of
        turns = 1 + int((now_s - self._next_due_s) / (one_of * self._period_s))
        self._next_due_s += turns * one_of * self._period_s
        before, self.before = self.before, None
        mission = self.conductor.mission
        nowhere = before is not None and before.wanted and mission.state == "waiting"
        if not (mission.wants_rounds or nowhere):
            return False
        tally = self.conductor.rounds.tally
        tally.due += turns * one_of
        tally.missed += turns - (not nowhere)
        tally.spared += turns * (one_of - 1)
        return not nowhere

    def _is_unplaced(self, now_s: float) -> bool:
        """Whether a restarted orchestrator does not know yet where the car is."""
        return (
            self.before is not None
            and now_s < self._unplaced_until_s
            and self.conductor.mission.state == "waiting"
        )

    def _start_round(self, now_s: float) -> None:
        """Start the round that is due, or count why it is not."""
        conductor = self.conductor
        rounds, latest = conductor.rounds, conductor.intake.latest
        speed = conductor.plan.config.speed or 1.0
        age_s = math.inf if latest is None else now_s - latest.receipt_mono_ns / 1e9
        if rounds.open:
            rounds.tally.missed += 1
        elif age_s * speed <= STALE_S:
            with span("start a round"):
                conductor.start_round()
        elif self._telemetry_waits():
            rounds.tally.missed += 1  # we are behind
        else:
            rounds.tally.unseeded += 1  # the vehicle says nothing

    def _leave_out(self, now_s: float) -> None:
        """Count a round that is due and will not be started: the drive is over."""
        waits = self.conductor.rounds.open and now_s >= self._next_due_s
        if (waits or now_s >= self._at_the_latest_s) and self._fall_due(now_s):
            self.conductor.rounds.tally.missed += 1

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
