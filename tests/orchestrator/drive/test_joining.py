from __future__ import annotations

import time
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import msgspec

from foretwin.contracts.drive import SpeedSample, VehicleInfo
from foretwin.contracts.mailbox import Mailbox
from foretwin.orchestrator.drive import joining
from foretwin.orchestrator.drive.joining import Joining
from tests.contracts.memory_bus import MemoryBus

START_NS = 1_000_000_000


class AskedBus(MemoryBus):
    """Counts what is asked; `then` is called once the first question is answered."""

    def __init__(self, then: Callable[[MemoryBus], None]) -> None:
        super().__init__()
        self._then, self.asked_s = then, list[float]()

    def request(
        self, channel: str, message: msgspec.Struct, mailbox: Mailbox, **asked: Any
    ) -> None:
        self.asked_s.append(time.monotonic())
        super().request(channel, message, mailbox, **asked)
        if len(self.asked_s) == 1:
            self._then(self)


class SaysWhatItIs(Mailbox):
    """Answers each question."""

    def __init__(self, info: VehicleInfo) -> None:
        super().__init__(1)
        self._info = info

    def put(self, item: Any) -> None:
        item.reply(self._info)


class WaitingConductor:
    """Knows what a drive does that waits for a live car."""

    def __init__(self, bus: MemoryBus) -> None:
        config = SimpleNamespace(vehicle_id="car", resolved_source="live")
        self.plan = SimpleNamespace(config=config, ros2=None)
        self.strangers = SimpleNamespace(expected=frozenset())
        self.alive: dict[str, float] = {}
        self.intake = SimpleNamespace(first_stamp_ns=None)
        self.mailbox, self.info = Mailbox(64), list[VehicleInfo]()
        bus.subscribe("speed", self.mailbox, vehicle="car")

    def handle(self, item: Any) -> None:
        self.intake.first_stamp_ns = item.message().stamp_ns

    def take_info(self, info: VehicleInfo) -> None:
        self.info.append(info)


def joined(
    then: Callable[[MemoryBus], None], *, most_questions: int = 50
) -> tuple[AskedBus, WaitingConductor]:
    """Let a car come once the first question found nobody."""
    bus = AskedBus(then)
    conductor = WaitingConductor(bus)
    one = Joining(
        bus,
        conductor,  # type: ignore[arg-type]
        SimpleNamespace(given_up=set()),  # type: ignore[arg-type]
        look_after=lambda *_: None,
        stop=lambda: len(bus.asked_s) >= most_questions,
    )
    one.all_there()
    return bus, conductor


def speaks(bus: MemoryBus) -> None:
    bus.publish("speed", SpeedSample(stamp_ns=START_NS, speed_mps=3.0), vehicle="car")


def test_a_live_car_that_comes_behind_the_question_is_asked_again() -> None:
    told = VehicleInfo(
        vehicle_id="car", time_base="boot", start_stamp_ns=START_NS, body_from_antenna_m=(1, 0, 1)
    )

    def comes(bus: MemoryBus) -> None:
        bus.serve("info", SaysWhatItIs(told), vehicle="car")
        speaks(bus)

    _, conductor = joined(comes)
    assert conductor.info == [told]


def test_a_live_car_that_does_not_know_the_question_drives_without_an_answer() -> None:
    bus, conductor = joined(speaks)
    (info,) = conductor.info
    assert (info.start_stamp_ns, info.body_from_antenna_m) == (START_NS, None)
    assert len(bus.asked_s) == 2, "before it was heard, and after it"


def test_who_waits_for_a_live_car_asks_now_and_then() -> None:
    bus, conductor = joined(lambda _: None, most_questions=4)
    assert bus.asked_s[-1] - bus.asked_s[0] >= 3 * joining.ASK_AGAIN_S
    assert conductor.info == []
