"""Samples that were missed are kept, and asked for: over cuts, and by who comes late."""

from __future__ import annotations

import time
from contextlib import ExitStack

from foretwin.contracts.bus import Mailbox, Received, ZenohBus
from foretwin.contracts.drive import SpeedSample
from foretwin.contracts.kept import LEAST_KEPT, most_kept
from foretwin.contracts.keys import CHANNELS, RECORDED, TELEMETRY_CHANNELS
from foretwin.contracts.ports import free_endpoint
from foretwin.contracts.setup import BusSetup
from tests.contracts.bus_sides import DEADLINE_S, publish_until_received
from tests.contracts.cut_link import CutLink

COUNT = 450


def speeds(sender: ZenohBus, begin: int, end: int) -> None:
    for number in range(begin, end):
        sender.publish("speed", SpeedSample(stamp_ns=number, speed_mps=1.0), vehicle="car")


def numbers(mailbox: Mailbox, wanted: int) -> set[tuple[int, int]]:
    """Take what lands until so many different messages came; return their senders and numbers."""
    found: set[tuple[int, int]] = set()
    deadline = time.monotonic() + DEADLINE_S
    while len(found) < wanted and time.monotonic() < deadline:
        item = mailbox.take(0.2)
        if isinstance(item, Received):
            found.add((item.sender, item.envelope().seq))
    return found


def test_what_is_recorded_is_kept_for_some_seconds_and_nothing_else_is() -> None:
    assert {CHANNELS[name].qos for name in (*TELEMETRY_CHANNELS, "state")} == {RECORDED}
    assert most_kept(CHANNELS["imu"]) == 100 * RECORDED.kept_s
    assert most_kept(CHANNELS["end"]) == LEAST_KEPT
    assert most_kept(CHANNELS["authority"]) == most_kept(CHANNELS["job"]) == 0


def test_who_comes_late_hears_what_is_kept_while_more_comes() -> None:
    setup, mailbox = BusSetup(endpoint=free_endpoint()), Mailbox(10_000)
    with ZenohBus(setup, router=True), ZenohBus(setup) as sender, ZenohBus(setup) as late:
        speeds(sender, 0, COUNT)
        late.subscribe("speed", mailbox, recover=True, vehicle="car")
        speeds(sender, COUNT, COUNT + 100)
        found = numbers(mailbox, COUNT + 100)
    assert {seq for _, seq in found} == set(range(COUNT + 100))
    assert len({sender for sender, _ in found}) == 1


def test_what_is_kept_can_be_asked_for_once_more() -> None:
    setup, mailbox = BusSetup(endpoint=free_endpoint()), Mailbox(10_000)
    with ZenohBus(setup, router=True), ZenohBus(setup) as sender, ZenohBus(setup) as late:
        speeds(sender, 0, COUNT)
        late.subscribe("speed", mailbox, recover=True, vehicle="car")
        assert len(numbers(mailbox, COUNT)) == COUNT
        late.recover("speed", vehicle="car")
        assert len(numbers(mailbox, COUNT)) == COUNT
        late.recover("imu", vehicle="car")  # nobody has subscribed to it: nothing to ask for


def test_a_cut_of_the_senders_link_loses_nothing() -> None:
    setup, mailbox, plain = BusSetup(endpoint=free_endpoint()), Mailbox(10_000), Mailbox(10_000)
    with ExitStack() as stack:
        stack.enter_context(ZenohBus(setup, router=True))
        link = stack.enter_context(CutLink(setup.endpoint))
        receiver = stack.enter_context(ZenohBus(setup))
        receiver.subscribe("speed", mailbox, recover=True, vehicle="car")
        receiver.subscribe("speed", plain, vehicle="car")
        sender = stack.enter_context(ZenohBus(BusSetup(endpoint=link.endpoint)))
        first = publish_until_received(sender, plain, vehicle="car").envelope().seq
        link.cut()
        speeds(sender, 0, COUNT)
        link.mend()
        last = publish_until_received(sender, plain, vehicle="car").envelope().seq
        assert last >= first + COUNT
        # A question of its own that reaches the sender while its link comes back finds nothing.
        receiver.recover("speed", vehicle="car")
        found = {seq for _, seq in numbers(mailbox, last + 1)}
    assert found >= set(range(last + 1))


def test_the_usual_rate_of_a_channel_says_how_many_samples_20_seconds_are() -> None:
    known = {name: most_kept(CHANNELS[name]) for name in ("imu", "speed", "state", "gnss", "end")}
    assert known == {"imu": 2000, "speed": 1000, "state": 1000, "gnss": 200, "end": 64}
