"""A bus whose session is stuck goes on with another one, and who uses it need not know."""

from __future__ import annotations

import socket
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing
from typing import NamedTuple

import pytest

from foretwin.contracts.bus import BusUnreachable, Mailbox, ZenohBus
from foretwin.contracts.drive import SpeedSample
from foretwin.contracts.fleet import ClockAnswer, ClockQuestion
from foretwin.contracts.keys import alive_key
from foretwin.contracts.mailbox import Received, Request
from foretwin.contracts.ports import LOOPBACK, ListenPlace, free_endpoint, free_port
from foretwin.contracts.redialled_bus import KNOCK_EVERY_S, RedialledBus, TcpDoor
from foretwin.contracts.setup import BusSetup
from foretwin.contracts.simulation import RunEnd
from tests.contracts.bus_sides import (
    DEADLINE_S,
    ROUTER,
    publish_until_received,
    python,
    take,
    take_until,
)
from tests.contracts.memory_bus import MemoryBus
from tests.pages import page

W0 = {"run": "r1", "process": "w-x-0"}
TOKEN = alive_key(**W0)
SETUP = BusSetup(endpoint="tls/far:7447")


class Line(MemoryBus):
    """A session whose link can be cut."""

    def __init__(self) -> None:
        super().__init__()
        self.whole, self.looked_at, self.closed = True, 0, False

    @property
    def connected(self) -> bool:
        self.looked_at += 1
        return self.whole

    def close(self) -> None:
        self.closed = True
        super().close()


class FakeDoor:
    """Opens when it is told to."""

    def __init__(self) -> None:
        self.open, self.knocks, self.left = False, 0, False

    def opens(self) -> bool:
        self.knocks += 1
        return self.open

    def close(self) -> None:
        self.left = True


class Far(NamedTuple):
    """A bus of which the sessions are at hand."""

    bus: RedialledBus
    lines: list[Line]
    door: FakeDoor
    refuses: list[str]
    """Why the next dialling fails, in turn."""


@pytest.fixture
def far() -> Iterator[Far]:
    lines: list[Line] = []
    door, refuses = FakeDoor(), list[str]()

    def dial(setup: BusSetup) -> Line:
        assert setup is SETUP
        if refuses:
            raise BusUnreachable(refuses.pop())
        lines.append(Line())
        return lines[-1]

    def at(place: ListenPlace) -> FakeDoor:
        assert place == ("far", 7447)
        return door

    with closing(RedialledBus(SETUP, dial=dial, door=at)) as bus:
        yield Far(bus, lines, door, refuses)
    assert all(line.closed for line in lines)
    assert door.left


def wait_until(condition: Callable[[], bool]) -> None:
    deadline_s = time.monotonic() + DEADLINE_S
    while not condition():
        assert time.monotonic() < deadline_s


def test_the_page_tells_how_often_it_knocks() -> None:
    assert f"knocks at the router's port every {1e3 * KNOCK_EVERY_S:.0f} ms" in page("bus.md")


def test_all_that_was_declared_holds_on_the_new_session(far: Far) -> None:
    ends, tokens, questions = Mailbox(8), Mailbox(8), Mailbox(8)
    far.bus.subscribe("run_end", ends, run="r1")
    far.bus.serve("clock", questions, **W0)
    far.bus.watch_alive(TOKEN, tokens)
    far.bus.declare_alive(TOKEN)
    assert take(tokens).up

    far.lines[0].whole, far.door.open = False, True
    wait_until(lambda: len(far.lines) == 2 and far.lines[0].closed)

    assert take(tokens).up, "of the new session"
    new = far.lines[1]
    assert far.lines[0].goes_on_as == [None]
    assert new.goes_on_as == [far.lines[0]]
    new.publish("run_end", RunEnd(stamp_ns=3), run="r1")
    assert take(ends).message().stamp_ns == 3
    replies = Mailbox(1)
    new.request("clock", ClockQuestion(), replies, **W0)
    question = take(questions)
    question.reply(ClockAnswer(utc_ns=5))
    assert take(replies).message.utc_ns == 5


def test_what_is_said_and_asked_goes_over_the_new_session(far: Far) -> None:
    far.lines[0].whole, far.door.open = False, True
    wait_until(lambda: len(far.lines) == 2 and far.lines[0].closed)
    ends, questions, replies = Mailbox(8), Mailbox(8), Mailbox(8)
    far.lines[1].subscribe("run_end", ends, run="r1")
    far.lines[1].serve("clock", questions, **W0)

    far.bus.publish("run_end", RunEnd(stamp_ns=3), run="r1")
    far.bus.request("clock", ClockQuestion(), replies, tag="t", **W0)

    assert take(ends).message().stamp_ns == 3
    take(questions).reply(ClockAnswer(utc_ns=5))
    assert take(replies).tag == "t"


def test_nobody_knocks_while_the_router_is_there(far: Far) -> None:
    wait_until(lambda: far.lines[0].looked_at > 3)

    assert far.door.knocks == 0


def test_behind_a_door_that_stays_shut_nobody_is_called(far: Far) -> None:
    far.lines[0].whole = False
    wait_until(lambda: far.door.knocks > 3)

    assert len(far.lines) == 1


def test_a_session_that_has_found_its_router_by_itself_stays(far: Far) -> None:
    far.bus.redial()

    assert [line.closed for line in far.lines] == [False, True]


def test_a_router_that_does_not_answer_yet_is_called_again(far: Far) -> None:
    far.refuses.extend(["no answer", "no answer"])
    far.lines[0].whole, far.door.open = False, True

    wait_until(lambda: len(far.lines) == 2 and far.lines[0].closed)
    assert far.refuses == []
    assert far.bus.connected


def test_a_bus_without_a_port_is_one_session(far: Far) -> None:
    setup = BusSetup(endpoint="unixsock-stream//tmp/x")
    lines: list[Line] = []

    def dial(_: BusSetup) -> Line:
        lines.append(Line())
        return lines[-1]

    with closing(RedialledBus(setup, dial=dial)):
        assert len(lines) == 1
        assert lines[0].goes_on_as == [], "it need not keep what it sends"
    assert lines[0].closed


def test_a_door_opens_where_somebody_listens() -> None:
    with socket.create_server((LOOPBACK, 0)) as server:
        door = TcpDoor(ListenPlace("localhost", server.getsockname()[1]))
        wait_until(door.opens)
    door.close()


def test_a_door_is_shut_where_nobody_listens() -> None:
    door = TcpDoor(ListenPlace(LOOPBACK, free_port()))

    assert [door.opens() for _ in range(7)] == 7 * [False]
    door.close()


def test_an_answer_that_takes_longer_than_a_knock_is_taken() -> None:
    """A full queue of callers lets the next ones wait, as a slow link does."""
    with ExitStack() as stack:
        server = stack.enter_context(socket.create_server((LOOPBACK, 0), backlog=0))
        place = ListenPlace(LOOPBACK, server.getsockname()[1])
        stack.enter_context(socket.create_connection(place))
        door = TcpDoor(place)
        begun_s = time.monotonic()
        assert not door.opens()
        assert time.monotonic() - begun_s > 0.9 * KNOCK_EVERY_S
        assert [door.opens() for _ in range(6)] == 6 * [False]
        assert len(door._knocks) == 5, "each is waited for, the oldest no longer"
        server.accept()[0].close()
        wait_until(door.opens)


def test_over_zenoh_a_worker_answers_again_through_another_router() -> None:
    first, second = BusSetup(endpoint=free_endpoint()), BusSetup(endpoint=free_endpoint())
    dialled = iter((first, second))
    door = FakeDoor()
    door.open = True
    questions, tokens = Mailbox(8), Mailbox(8)
    with ExitStack() as stack:
        before = stack.enter_context(python("-c", ROUTER, first.endpoint))
        asker = stack.enter_context(ZenohBus(second, router=True))
        asker.watch_alive(alive_key(run="r1", process="*"), tokens)
        bus = RedialledBus(first, dial=lambda _: ZenohBus(next(dialled)), door=lambda _: door)
        far = stack.enter_context(closing(bus))
        far.serve("clock", questions, **W0)
        far.declare_alive(TOKEN)

        before.kill()

        assert take_until(tokens, lambda item: item.up).key == TOKEN
        replies = Mailbox(1)
        asker.request("clock", ClockQuestion(), replies, timeout_s=DEADLINE_S, **W0)
        question = take(questions)
        assert isinstance(question, Request)
        question.reply(ClockAnswer(utc_ns=5))
        assert take(replies).message.utc_ns == 5


def test_over_zenoh_what_was_sent_into_a_dead_link_can_be_asked_for() -> None:
    """By its numbers it is one sender throughout, so that who counts misses nothing."""
    first, second = BusSetup(endpoint=free_endpoint()), BusSetup(endpoint=free_endpoint())
    dialled = iter((first, second))
    door = FakeDoor()
    heard = Mailbox(1000)
    with ExitStack() as stack:
        before = stack.enter_context(python("-c", ROUTER, first.endpoint))
        recorder = stack.enter_context(ZenohBus(second, router=True))
        recorder.subscribe("speed", heard, recover=True, vehicle="car")
        bus = RedialledBus(first, dial=lambda _: ZenohBus(next(dialled)), door=lambda _: door)
        car = stack.enter_context(closing(bus))
        for number in range(40):
            car.publish("speed", SpeedSample(stamp_ns=number, speed_mps=1.0), vehicle="car")
        before.kill()
        wait_until(lambda: not car.connected)
        for number in range(40, 60):
            car.publish("speed", SpeedSample(stamp_ns=number, speed_mps=1.0), vehicle="car")
        door.open = True
        wait_until(lambda: car.connected)
        new = publish_until_received(car, heard, vehicle="car")
        assert new.envelope().seq >= 60, "it counts on"
        found: dict[tuple[int, int], int] = {}

        def all_came() -> bool:
            recorder.recover("speed", vehicle="car")
            while isinstance(item := heard.take(0.2), Received):
                envelope = item.envelope()
                found[item.sender, envelope.seq] = envelope.message.stamp_ns
            return len(found) >= 60

        wait_until(all_came)
    assert len({sender for sender, _ in found}) == 1
    assert {seq: stamp for (_, seq), stamp in found.items() if seq < 60} == {
        number: number for number in range(60)
    }
