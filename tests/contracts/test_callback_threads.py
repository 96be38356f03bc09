"""Python knows a thread of the bus's again that called before."""

from __future__ import annotations

import threading
from typing import Any

from foretwin.contracts.bus import Mailbox
from foretwin.contracts.callback_threads import keep_thread_state
from foretwin.contracts.drive import SpeedSample
from tests.contracts.bus_sides import publish_until_received, take, zenoh_sides


class _Here(threading.local):
    """Goes with what Python knows of a thread."""

    calls = 0


class _NotingMailbox(Mailbox):
    """Notes of each item the how many-th it is that its thread brought."""

    def __init__(self, depth: int) -> None:
        super().__init__(depth)
        self._here, self.calls = _Here(), list[tuple[int, int]]()

    def put(self, item: Any) -> None:
        self._here.calls += 1
        self.calls.append((threading.get_ident(), self._here.calls))
        super().put(item)


def test_a_thread_that_brings_samples_stays_known() -> None:
    mailbox = _NotingMailbox(100)
    with zenoh_sides(lossless=True) as sides:
        sides.far.subscribe("speed", mailbox, vehicle="ego")
        publish_until_received(sides.near, mailbox)
        mailbox.calls.clear()
        for n in range(20):
            sides.near.publish("speed", SpeedSample(stamp_ns=n, speed_mps=1.0), vehicle="ego")
            take(mailbox)
    threads = {ident for ident, _ in mailbox.calls}
    assert threading.get_ident() not in threads
    for ident in threads:
        counts = [calls for who, calls in mailbox.calls if who == ident]
        assert counts == list(range(counts[0], counts[0] + len(counts)))


def test_a_thread_of_python_s_own_may_call_it_and_end() -> None:
    thread = threading.Thread(target=lambda: [keep_thread_state() for _ in range(3)])
    thread.start()
    thread.join()
    keep_thread_state()
    assert not thread.is_alive()
