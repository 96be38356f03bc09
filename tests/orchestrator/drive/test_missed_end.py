"""The vehicle's last word is asked for where nothing comes any more; another drive's is none."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from foretwin.contracts.bus import Mailbox
from foretwin.contracts.drive import DriveEnd
from foretwin.contracts.keys import key
from foretwin.orchestrator.drive.missed_end import AGAIN_S, SILENT_S, MissedEnd
from tests.contracts.memory_bus import MemoryBus

S = 1_000_000_000
END_KEY = key("end", vehicle="car")


class Drive:
    """What is known of the vehicle, and who asks for its end."""

    def __init__(self, *, begun: bool = False) -> None:
        self.bus, self.mailbox = MemoryBus(), Mailbox(10)
        self.intake: Any = SimpleNamespace(states=0, end=None, latest=None)
        self._missed = MissedEnd(self.bus, self.mailbox, "car", begun=begun)

    def asked_at(self, from_s: int, to_s: int) -> list[int]:
        asked = []
        for now_s in range(from_s, to_s):
            before = len(self.bus.recovered), len(self.bus.mailboxes("end"))
            self._missed.look(self.intake, float(now_s))
            if (len(self.bus.recovered), len(self.bus.mailboxes("end"))) != before:
                asked.append(now_s)
        return asked

    def hear(self, stamp_s: int) -> None:
        self.intake.states += 1
        self.intake.latest = SimpleNamespace(state=SimpleNamespace(stamp_ns=stamp_s * S))


def test_nobody_asks_while_telemetry_comes_or_before_it_does() -> None:
    drive = Drive()
    assert drive.asked_at(0, 20) == []
    for now_s in range(20, 40):
        drive.hear(now_s)
        assert drive.asked_at(now_s, now_s + 1) == []


def test_where_nothing_comes_any_more_it_is_asked_for_again_and_again() -> None:
    assert (SILENT_S, AGAIN_S) == (2.0, 2.0)
    drive = Drive()
    drive.hear(10)
    assert drive.asked_at(10, 17) == [12, 14, 16]
    assert drive.bus.mailboxes("end") == [drive.mailbox], "one subscription"
    assert drive.bus.recovered == [END_KEY, END_KEY]
    drive.hear(17)
    assert drive.asked_at(17, 20) == [19]


def test_who_goes_on_with_a_drive_asks_though_it_has_heard_nothing() -> None:
    assert Drive(begun=True).asked_at(0, 3) == [2]


@pytest.mark.parametrize(("stamp_s", "counts"), [(3, False), (9, True), (10, True), (12, True)])
def test_the_end_of_another_drive_does_not_count(stamp_s: int, counts: bool) -> None:
    drive = Drive()
    drive.hear(10)
    assert drive.asked_at(0, 3) == [2]
    drive.intake.end = DriveEnd(stamp_ns=stamp_s * S, published={})
    drive.asked_at(3, 4)
    assert (drive.intake.end is not None) is counts


def test_an_end_that_was_heard_counts_whatever_its_stamp() -> None:
    drive = Drive()
    drive.hear(10)
    drive.intake.end = DriveEnd(stamp_ns=0, published={})
    drive.asked_at(0, 2)
    assert drive.intake.end is not None
