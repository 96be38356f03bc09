"""The lock-step loop: no clock; the vehicle goes on only when every round and World is complete.

Results are a pure function of log, map, configuration and seed: samples are taken in the order of
their stamps, whatever the order in which the network brought them.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field

from foretwin.contracts.bus import Received, Reply
from foretwin.contracts.codec import SchemaMismatch
from foretwin.contracts.drive import AdvanceReply, AdvanceRequest
from foretwin.contracts.keys import TELEMETRY_CHANNELS
from foretwin.contracts.trace import item_name, span
from foretwin.orchestrator.drive.conductor import Conductor
from foretwin.orchestrator.drive.live_loop import is_telemetry
from foretwin.telemetry.estimator.reordering import rank_in_instant

ADVANCE_TIMEOUT_S = 120.0
STUCK_AFTER_S = 120.0
END_SILENCE_S = 5.0
"""Having said nothing for so long, neither vehicle nor mirror have a last word."""


class LockStepError(RuntimeError):
    """A part of the drive did not answer; the message says which."""


@dataclass(slots=True)
class LockStepLoop:
    """Runs a conductor step by step until the drive ends or `stop` says so."""

    conductor: Conductor
    housekeeping: Callable[[float], None]
    stop: Callable[[], bool]
    _samples: list[Received] = field(default_factory=list)
    _received: Counter[str] = field(default_factory=Counter)
    _advanced: AdvanceReply | None = None
    _vehicle_failed: str | None = None

    def run(self) -> bool:
        """Return True where the drive ended by itself, False where it was stopped."""
        conductor = self.conductor
        assert conductor.intake.info is not None
        config = conductor.plan.config
        parameters, questions = conductor.tuning.parameters, conductor.questions
        period_ns = round(1e9 / config.rate_hz)
        until_ns = conductor.intake.start_stamp_ns + round(config.start_s * 1e9)
        while True:
            self._advance(until_ns)
            if self.stop():
                return False
            advanced = self._advanced
            assert advanced is not None
            with span("samples of a step"):
                for sample in self._in_order():
                    conductor.handle(sample)
            self._wait("worlds", lambda: not conductor.worlds.building)
            conductor.active_world.announce()
            self._wait("the mirror", lambda: not conductor.questions.unanswered)
            self._wait("tuning", lambda: not conductor.tuning.weighing)
            self._wait("virtual traffic", lambda: not conductor.traffic.is_behind)
            conductor.tuning.take_weighed()
            conductor.make_changes()
            self._wait("changes", lambda: not questions.unanswered and parameters.settled)
            # Weighed while the round and the next step go on; counts from the step after.
            conductor.tuning.weigh(advanced.published)
            if not advanced.ended:
                conductor.rounds.tally.due += conductor.mission.wants_rounds
                if conductor.start_round():
                    self._wait("the round", lambda: not conductor.rounds.open)
                    self._wait("its siblings", lambda: not conductor.rounds.siblings.waits)
                self._wait("virtual traffic", lambda: not questions.unanswered)
            if self.stop():
                return False
            if advanced.ended:
                self._wait("tuning", lambda: not conductor.tuning.weighing)
                conductor.tuning.take_weighed()
                self._wait_for_end()
                return True
            until_ns += period_ns

    def _advance(self, until_ns: int) -> None:
        conductor = self.conductor
        self._advanced = None
        question, vehicle = (
            AdvanceRequest(until_stamp_ns=until_ns),
            conductor.plan.config.vehicle_id,
        )
        conductor.bus.request(
            "advance", question, conductor.mailbox, timeout_s=ADVANCE_TIMEOUT_S, vehicle=vehicle
        )
        self._wait("the vehicle", self._all_there)

    def _all_there(self) -> bool:
        if self._vehicle_failed is not None:
            raise LockStepError(f"the vehicle's process does not answer: {self._vehicle_failed}")
        advanced = self._advanced
        return advanced is not None and all(
            self._received[channel] >= count for channel, count in advanced.published.items()
        )

    def _wait_for_end(self) -> None:
        """Take the vehicle's last word and what the mirror still has to say."""
        conductor = self.conductor
        last = conductor.intake.now_stamp_ns
        heard_ns, heard_s = conductor.mirror.stamp_ns, time.monotonic()

        def said() -> bool:
            nonlocal heard_ns, heard_s
            for sample in self._in_order():
                conductor.handle(sample)
            if conductor.mirror.stamp_ns != heard_ns:
                heard_ns, heard_s = conductor.mirror.stamp_ns, time.monotonic()
            # What it still says after that is taken once it has ended.
            silent = time.monotonic() - heard_s > END_SILENCE_S
            mirrored = heard_ns >= last - 200_000_000
            return (conductor.intake.end is not None and mirrored) or silent

        self._wait("the end", said)

    def _wait(self, what: str, over: Callable[[], bool]) -> None:
        """Handle what comes until `over`; telemetry is laid aside for its order."""
        conductor = self.conductor
        deadline = time.monotonic() + STUCK_AFTER_S
        next_housekeeping_s = 0.0
        while not over() and not self.stop():
            now_s = time.monotonic()
            if now_s >= next_housekeeping_s:
                self.housekeeping(now_s)
                next_housekeeping_s = now_s + 0.1
            if now_s > deadline:
                raise LockStepError(f"waited {STUCK_AFTER_S:.0f} s for {what}")
            item = conductor.mailbox.take(0.05)
            if item is None:
                continue
            if is_telemetry(item):
                assert isinstance(item, Received)
                self._samples.append(item)
                self._received[item.channel] += 1
            elif isinstance(item, Reply) and item.channel == "advance":
                if isinstance(item.message, AdvanceReply):
                    self._advanced = item.message
                else:
                    self._vehicle_failed = item.error
            else:
                with span(item_name(item)):
                    conductor.handle(item)

    def _in_order(self) -> list[Received]:
        """Return the samples laid aside by stamp, then as an instant's are taken, then number."""
        channels = sorted(TELEMETRY_CHANNELS, key=rank_in_instant)
        order = {name: place for place, name in enumerate(channels)}
        keyed = []
        for sample in self._samples:
            place = order[sample.channel]
            try:
                envelope = sample.envelope()
            except SchemaMismatch:
                keyed.append(((0, place, 0), sample))  # refused and counted by who takes it
            else:
                keyed.append(((envelope.message.stamp_ns, place, envelope.seq), sample))
        self._samples = []
        return [sample for _, sample in sorted(keyed, key=lambda pair: pair[0])]
