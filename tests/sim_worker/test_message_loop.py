"""Taking messages: what is unfit is told and passed over, what is there at the end is taken."""

from __future__ import annotations

import logging
import threading

import pytest

from foretwin.contracts.bus import Mailbox, Received, Reply, Request
from foretwin.contracts.drive import VehicleState
from foretwin.contracts.refusals import Refusals
from foretwin.contracts.simulation import PrepareRequest
from foretwin.sim_worker.message_loop import passed_over_where_unfit, take_messages
from tests.contracts.memory_bus import MemoryBus
from tests.sim_worker.places import state_at

log = logging.getLogger("test")


def states(count: int) -> tuple[MemoryBus, Mailbox]:
    bus, mailbox = MemoryBus(), Mailbox(64)
    bus.subscribe("state", mailbox, vehicle="ego")
    for k in range(count):
        bus.publish("state", state_at(float(k), 0.0, stamp_ns=k), vehicle="ego")
    return bus, mailbox


class Life:
    """A run that ends when it is told to."""

    over = False


def test_bytes_that_are_no_message_are_counted_and_told_once(
    caplog: pytest.LogCaptureFixture,
) -> None:
    refusals = Refusals()
    for _ in range(3):
        item = Received("state", "foretwin/vehicle/ego/state", b"hello", VehicleState)
        with passed_over_where_unfit(item, refusals=refusals, log=log):
            item.message()
    assert len(refusals) == 3
    assert [r.levelname for r in caplog.records] == ["WARNING"]


def test_a_question_that_goes_wrong_is_answered_in_one_line(
    caplog: pytest.LogCaptureFixture,
) -> None:
    bus, asked, answers = MemoryBus(), Mailbox(4), Mailbox(4)
    bus.serve("prepare", asked, run="r", process="w0")
    question = PrepareRequest(world_id="w")
    bus.request("prepare", question, answers, timeout_s=5.0, run="r", process="w0")
    item = asked.take()
    assert isinstance(item, Request)
    with passed_over_where_unfit(item, refusals=Refusals(), log=log):
        raise FileNotFoundError("no World w")
    answer = answers.take()
    assert isinstance(answer, Reply)
    assert answer.error == "FileNotFoundError: no World w"
    assert [r.getMessage() for r in caplog.records] == ["prepare refused"]


@pytest.mark.parametrize("lossless", [True, False])
def test_what_is_there_when_the_run_ends_is_taken(lossless: bool) -> None:
    _, mailbox = states(5)
    life = Life()
    life.over = True
    taken: list[int] = []
    take_messages(
        mailbox, lambda item: taken.append(item.message().stamp_ns), life, lossless=lossless
    )
    assert taken == [0, 1, 2, 3, 4]


def test_live_messages_are_taken_in_portions_and_in_lock_step_at_once() -> None:
    """A portion's wait (here for ever) is not waited for where nothing may be lost."""
    _, mailbox = states(1)
    life, first = Life(), threading.Event()

    def handle(_: object) -> None:
        first.set()
        life.over = True

    running = threading.Thread(
        target=take_messages,
        args=(mailbox, handle, life),
        kwargs={"lossless": True, "gather_s": 1000.0},
    )
    running.start()
    assert first.wait(10.0)
    running.join(10.0)
    assert not running.is_alive()
