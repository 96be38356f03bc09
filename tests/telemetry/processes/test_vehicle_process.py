from __future__ import annotations

from typing import Any

import pytest

from foretwin.contracts.anchor import Anchor
from foretwin.contracts.bus import Mailbox, Received, Reply
from foretwin.contracts.drive import (
    AdvanceReply,
    AdvanceRequest,
    DriveEnd,
    InfoRequest,
    VehicleInfo,
)
from foretwin.contracts.fleet import ClockQuestion
from foretwin.contracts.keys import alive_key
from foretwin.contracts.lights import ShownLights
from foretwin.contracts.process import ProcessLife
from foretwin.contracts.setup import BusSetup, ProcessSetup
from foretwin.contracts.simulation import RunEnd
from foretwin.telemetry.processes.replay import ReplaySource
from foretwin.telemetry.processes.vehicle_process import VehicleProcess
from tests.contracts.memory_bus import MemoryBus
from tests.contracts.test_anchor import LOT, WORLD
from tests.telemetry.processes.test_replay import SECOND_NS, START_NS, recorded_minute

ORCHESTRATOR = alive_key(run="r", process="orchestrator")


SETUP = ProcessSetup(
    run_id="r", process_id="vehicle", vehicle_id="car", bus=BusSetup(endpoint=""), log_file=""
)


class Rig:
    """A process on a bus in memory, with a clock that only we move."""

    def __init__(
        self, *, speed: float | None, end_s: float = 3.0, anchor: Anchor | None = None
    ) -> None:
        self.now_s = 100.0
        self.bus = MemoryBus()
        self.inbox = Mailbox(1000)
        for channel in ("gnss", "speed", "end"):
            self.bus.subscribe(channel, self.inbox, vehicle="car")
        source = ReplaySource(recorded_minute(), vehicle_id="car", end_s=end_s)
        self.process = VehicleProcess(
            source,
            bus=self.bus,
            life=ProcessLife(SETUP, self.bus, mono_s=lambda: self.now_s),
            vehicle_id="car",
            speed=speed,
            anchor=anchor,
            mono_s=lambda: self.now_s,
        )

    def received(self) -> list[Received]:
        items = []
        while (item := self.inbox.take()) is not None:
            items.append(item)
        return items

    def seconds(self) -> list[float]:
        return [(r.message().stamp_ns - START_NS) / SECOND_NS for r in self.received()]

    def ask(self, channel: str, message: Any) -> Any:
        answers = Mailbox(1)
        self.bus.request(channel, message, answers, vehicle="car")
        assert self.process.step()
        reply = answers.take(1.0)
        assert isinstance(reply, Reply)
        assert reply.error is None
        return reply.message

    def advance(self, until_s: float) -> AdvanceReply:
        until_ns = START_NS + round(until_s * SECOND_NS)
        return self.ask("advance", AdvanceRequest(until_stamp_ns=until_ns))


def test_nothing_is_sent_before_the_orchestrator_is_there() -> None:
    rig = Rig(speed=1.0)
    rig.now_s += 60.0
    assert rig.process.step()
    assert rig.received() == []
    rig.bus.declare_alive(ORCHESTRATOR)
    rig.process.step()
    assert rig.seconds() == [0.0, 0.0]


def test_samples_leave_when_their_time_has_come() -> None:
    rig = Rig(speed=2.0)
    rig.bus.declare_alive(ORCHESTRATOR)
    rig.process.step()
    sent = rig.seconds()
    for _ in range(5):
        rig.now_s += 0.101
        rig.process.step()
    assert sent + rig.seconds() == [0.0, 0.0, 0.5, 1.0, 1.0]


def test_a_pause_is_caught_up_in_portions_that_leave_time_for_questions() -> None:
    rig = Rig(speed=1.0)
    rig.bus.declare_alive(ORCHESTRATOR)
    rig.process.step()
    rig.now_s += 2.0
    rig.process.step()
    assert rig.seconds() == [0.0, 0.0]
    for _ in range(10):
        rig.process.step()
    assert rig.seconds() == [0.5, 1.0, 1.0, 1.5, 2.0, 2.0]


def test_it_sleeps_until_the_next_sample_is_due_and_looks_now_and_then_in_a_gap(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    rig = Rig(speed=2.0)
    rig.bus.declare_alive(ORCHESTRATOR)
    rig.process.step()
    assert rig.seconds() == [0.0, 0.0]
    slept_s: list[float] = []

    def sleep(_: Mailbox, most_s: float) -> None:
        slept_s.append(most_s)
        rig.now_s += most_s

    monkeypatch.setattr(Mailbox, "gather", sleep)
    while rig.process.published["speed"] != 3:
        rig.process.step()
    assert rig.seconds() == [0.5, 1.0, 1.0]
    assert rig.now_s == pytest.approx(100.0 + 1.0 / 2.0)
    assert slept_s[:12] == [0.02] * 12
    assert len(slept_s) == 2 * 13


def test_samples_that_follow_close_on_each_other_leave_together(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    rig = Rig(speed=500.0)
    rig.bus.declare_alive(ORCHESTRATOR)
    rig.process.step()
    rig.seconds()
    slept_s: list[float] = []
    monkeypatch.setattr(Mailbox, "gather", lambda _, most_s: slept_s.append(most_s))
    rig.process.step()
    assert slept_s == [0.005]


def test_lock_step_publishes_before_it_answers() -> None:
    rig = Rig(speed=None)
    rig.bus.declare_alive(ORCHESTRATOR)
    rig.process.step()
    assert rig.received() == []
    reply = rig.advance(1.0)
    assert reply == AdvanceReply(published={"gnss": 2, "speed": 3}, ended=False)
    assert len(rig.received()) == 5
    assert rig.advance(1.0) == reply
    assert rig.received() == []
    last = rig.advance(9.0)
    assert last == AdvanceReply(published={"gnss": 4, "speed": 7}, ended=True)
    *_, end = rig.received()
    assert end.message() == DriveEnd(
        stamp_ns=START_NS + 3 * SECOND_NS, published=last.published, skipped_invalid=2
    )


def test_after_the_end_it_still_answers_until_the_run_is_over() -> None:
    rig = Rig(speed=None)
    rig.advance(9.0)
    rig.received()
    assert rig.advance(10.0).ended
    assert rig.received() == []
    info = rig.ask("info", InfoRequest())
    assert isinstance(info, VehicleInfo)
    assert info.vehicle_id == "car"
    rig.bus.publish("run_end", RunEnd(stamp_ns=0), run="r")
    assert not rig.process.step()


def test_it_leaves_when_the_orchestrator_stays_away() -> None:
    rig = Rig(speed=1.0)
    rig.bus.declare_alive(ORCHESTRATOR)
    assert rig.process.step()
    rig.bus.lose(ORCHESTRATOR)
    assert rig.process.step()
    rig.now_s += 0.5 * SETUP.grace_s
    rig.bus.declare_alive(ORCHESTRATOR)
    assert rig.process.step()
    rig.now_s += 2.0 * SETUP.grace_s
    assert rig.process.step()
    rig.bus.lose(ORCHESTRATOR)
    rig.process.step()
    rig.now_s += 1.1 * SETUP.grace_s
    assert not rig.process.step()


def test_a_speed_must_be_positive() -> None:
    with pytest.raises(ValueError, match="positive"):
        Rig(speed=0.0)


def test_a_drive_on_a_lot_is_published_in_the_world() -> None:
    lot, there = (Rig(speed=None, anchor=one) for one in (None, Anchor(lot=LOT, world=WORLD)))
    fixes = []
    for rig in (lot, there):
        rig.advance(1.0)
        fixes.append([item.message() for item in rig.received() if item.channel == "gnss"])
    assert len(fixes[0]) == len(fixes[1]) > 0
    moved = [Anchor(lot=LOT, world=WORLD).world_from_lot(one.position, 0.0) for one in fixes[0]]
    assert [one.position for one in fixes[1]] == [one.position for one in moved]


def test_it_says_the_time_on_board_once_its_clock_runs() -> None:
    rig = Rig(speed=2.0)
    answers = Mailbox(1)
    rig.bus.request("vehicle_clock", ClockQuestion(), answers, vehicle="car")
    rig.process.step()
    unasked = answers.take(1.0)
    assert isinstance(unasked, Reply)
    assert unasked.error == "no clock runs"
    rig.bus.declare_alive(ORCHESTRATOR)
    rig.process.step()
    rig.now_s += 0.75
    told = rig.ask("vehicle_clock", ClockQuestion())
    assert (told.stamp_ns - START_NS) / SECOND_NS == pytest.approx(1.5)


def test_it_hands_on_what_the_run_says_on_a_channel() -> None:
    rig, heard = Rig(speed=1.0), []
    rig.process.hear("lights", heard.append, run="r")
    said = ShownLights(stamp_ns=7, world_id="w")
    rig.bus.publish("lights", said, run="r")
    assert rig.process.step()
    assert heard == [said]
