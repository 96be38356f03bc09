"""The process that watches a vehicle: findings out, parameters in, in lock step the same bits."""

from __future__ import annotations

import random
from collections import Counter
from typing import Any

import numpy as np
import pytest

from foretwin.contracts.bus import Mailbox, Received, Reply, Request
from foretwin.contracts.gap import GapSample
from foretwin.contracts.mailbox import Item
from foretwin.contracts.setup import BusSetup, TuningSetup
from foretwin.contracts.tuning import TuneReply, TuneRequest, UseVehicle
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.orchestrator.tuning.parameter_versions import ParameterVersions
from foretwin.sim_worker.analysis.process import TuningWorker
from foretwin.sim_worker.analysis.tuning import SAMPLES
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.telemetry.estimator.estimator import StateEstimator
from foretwin.telemetry.standin.source import START_STAMP_NS
from tests.contracts.memory_bus import MemoryBus
from tests.sim_worker.driving import altered
from tests.telemetry.city_drive import city_drive
from tests.telemetry.standin_drive import FRAME

CAR = load_vehicle()
IDS: dict[str, Any] = {"run": "r1", "process": "tuning"}
HIDDEN_RATIO = 15.3
"""The bundled stand-in car's."""


class Watched:
    """A tuning process in lock step, on a bus in memory, and a car that drives through town."""

    def __init__(
        self, vehicle: VehicleParameters, *, shuffled: bool = False, hasty: bool = False
    ) -> None:
        self.bus = MemoryBus()
        self._inbox, self.answers, info = Mailbox(100_000), Mailbox(16), Mailbox(16)
        setup = TuningSetup(
            run_id="r1",
            process_id="tuning",
            vehicle_id="standin",
            log_file="",
            bus=BusSetup(endpoint="tcp/127.0.0.1:1", lossless=True),
            vehicle=vehicle,
            drive_frame=FRAME,
        )
        self._worker = TuningWorker(setup, self.bus, self._inbox)
        for channel in ("tune", "use_vehicle"):
            self.bus.serve(channel, self._inbox, **IDS)
        for channel in (*SAMPLES, "state"):
            self.bus.subscribe(channel, self._inbox, vehicle="standin")
        self.bus.serve("info", info, vehicle="standin")
        self._info = info
        drive = city_drive()
        self._known = drive.source.info
        self._estimator = StateEstimator(self._known)
        self._waiting = [pair for pair in drive.samples if pair[0] in SAMPLES]
        self._published: Counter[str] = Counter()
        self._random = random.Random(1) if shuffled else None
        self._hasty = hasty
        self._early: set[int] = set()

    def step(self, until_s: float) -> TuneReply:
        """Drive on, and have the process weigh it."""
        until_ns = START_STAMP_NS + round(until_s * 1e9)
        count = sum(message.stamp_ns <= until_ns for _, message in self._waiting)
        due: list[tuple[str, Any]] = []
        for channel, message in self._waiting[:count]:
            due.append((channel, message))
            state = self._estimator.handle(channel, message)
            if state is not None:
                due.append(("state", state))
        self._waiting = self._waiting[count:]
        for channel, message in due:
            if id(message) not in self._early:
                self.bus.publish(channel, message, vehicle="standin")
            self._published[channel] += 1
        if self._hasty:
            for channel, message in self._waiting[:900]:
                # The others are still on their way.
                if channel in ("speed", "control") and id(message) not in self._early:
                    self.bus.publish(channel, message, vehicle="standin")
                    self._early.add(id(message))
        published = dict(self._published)
        states = published.pop("state")
        asked = TuneRequest(published=published, states=states)
        self.bus.request("tune", asked, self.answers, **IDS)
        self._settle()
        reply = self.answers.take()
        assert isinstance(reply, Reply)
        assert isinstance(reply.message, TuneReply), reply.error
        return reply.message

    def use(self, use: UseVehicle) -> None:
        self.bus.request("use_vehicle", use, self.answers, **IDS)
        self._settle()
        reply = self.answers.take()
        assert isinstance(reply, Reply)
        assert reply.message == use

    def _settle(self) -> None:
        items: list[Item] = []
        while (item := self._inbox.take()) is not None:
            items.append(item)
        if self._random is not None:
            self._random.shuffle(items)
        for item in items:
            self._worker.handle(item)
            if isinstance(question := self._info.take(), Request):
                question.reply(self._known)
                while isinstance(told := self._inbox.take(), Reply | Received):
                    self._worker.handle(told)


def rms(samples: list[GapSample], quantity: str) -> float:
    return float(np.sqrt(np.mean([getattr(sample, quantity) ** 2 for sample in samples])))


@pytest.mark.judge
def test_a_wrong_steering_ratio_is_found_counts_and_the_gap_falls() -> None:
    """The twin believes in 18; the car's own 15.3 is hidden from it."""
    wrong = altered(CAR, steering_ratio=18.0)
    watched = Watched(wrong)
    handler = ParameterVersions(wrong, vehicle_id="standin", ask=lambda _, use: watched.use(use))
    changed_s = None
    before: list[GapSample] = []
    after: list[GapSample] = []
    for second in range(2, 60, 2):
        reply = watched.step(float(second))
        short = [one for one in reply.gaps if one.horizon_s == 2.0]
        if changed_s is None:
            before += short
        elif second > changed_s + 2:
            after += short
        for told in reply.identifications:
            handler.apply(told)
        changes = handler.hand_over(["tuning"], watcher="tuning", stamp_ns=0)
        if any(change.name == "steering_ratio" for change in changes) and changed_s is None:
            changed_s = second
        if len(after) >= 10:
            break
    ratio = handler.in_force.vehicle.steering_ratio.value
    assert ratio == pytest.approx(HIDDEN_RATIO, rel=0.02)
    assert all(sample.independent for sample in before + after)
    falls = rms(before, "across_m"), rms(after, "across_m")
    print(f"gap across after 2 s: {falls[0]:.3f} m before, {falls[1]:.3f} m after, {changed_s} s")
    assert falls[1] < 0.4 * falls[0]
    assert rms(after, "yaw_rad") < 0.4 * rms(before, "yaw_rad")
    first = next(change for change in handler.made if change.name == "steering_ratio")
    assert (first.before, first.origin) == (18.0, "identified")
    last = [change for change in handler.made if change.name == "steering_ratio"][-1]
    handler.note([handler.in_force.rollback("steering_ratio", stamp_ns=0)])
    handler.hand_over(["tuning"], watcher="tuning", stamp_ns=0)
    assert watched._worker._watch._in_force.steering_ratio.value == last.before


def test_messages_that_overtake_each_other_change_no_bit() -> None:
    replies = []
    for shuffled in (False, True):
        watched = Watched(CAR, shuffled=shuffled)
        replies.append([watched.step(second) for second in (2.0, 3.5, 6.0)])
    assert replies[0] == replies[1]
    assert sum(len(reply.gaps) for reply in replies[0]) >= 6


def test_what_comes_before_it_is_due_changes_no_bit() -> None:
    calm, hasty = Watched(CAR), Watched(CAR, hasty=True)
    for second in range(1, 6):
        assert calm.step(float(second)) == hasty.step(float(second))


def test_what_cannot_be_used_is_passed_over_and_the_question_answered() -> None:
    watched = Watched(CAR)
    watched.step(2.0)
    nonsense = Received("speed", "k", b"nonsense", VehicleParameters)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("foretwin.sim_worker.analysis.process.log.exception", lambda *_: None)
        watched._worker.handle(nonsense)
    watched._published["speed"] += 1
    assert isinstance(watched.step(2.5), TuneReply)


def test_before_the_vehicle_says_what_it_is_nothing_is_weighed() -> None:
    use = UseVehicle(stamp_ns=0, vehicle=altered(CAR, mass_kg=1300.0), version=1)
    watched = Watched(CAR)
    watched.use(use)
    watched.step(2.0)
    assert watched._worker._watch._in_force == use.vehicle
