"""What only a network can do: lose processes, lose the router, refuse to be reached."""

from __future__ import annotations

import json
import time
from contextlib import ExitStack

import pytest

from foretwin.contracts.bus import BusUnreachable, Mailbox, ZenohBus, zenoh_config
from foretwin.contracts.drive import SpeedSample
from foretwin.contracts.keys import alive_key
from foretwin.contracts.ports import free_endpoint
from foretwin.contracts.setup import BusSetup
from foretwin.contracts.simulation import PrepareRequest
from tests.contracts.bus_sides import (
    DEADLINE_S,
    MEMBER,
    ROUTER,
    ask_until_served,
    publish_until_received,
    python,
    take,
    take_until,
    zenoh_sides,
)
from tests.starvation import kept_waiting

W0 = {"run": "r1", "process": "w0"}


@pytest.mark.parametrize("router", [True, False])
def test_nobody_looks_for_others_or_is_found_by_them(router: bool) -> None:
    """Who is met by scouting speaks past the router, and past what it forbids."""
    config = zenoh_config(BusSetup(endpoint="tcp/127.0.0.1:1"), router=router)

    for setting in ("multicast/enabled", "gossip/enabled"):
        assert config.get_json(f"scouting/{setting}") == "false", setting
    assert bool(json.loads(config.get_json("listen/endpoints"))) is router


def test_a_killed_process_is_seen_at_once_and_its_questions_end() -> None:
    setup = BusSetup(endpoint=free_endpoint())
    alive, replies = Mailbox(10), Mailbox(10)
    with ZenohBus(setup, router=True) as bus:
        bus.watch_alive(alive_key(run="r1", process="*"), alive)
        with python("-c", MEMBER, setup.endpoint, alive_key(**W0)) as member:
            assert take(alive).up
            deadline = time.monotonic() + DEADLINE_S
            bus.request("prepare", PrepareRequest(world_id="abc"), replies, **W0)
            # The token may be known a moment before the way to the member's questions is.
            while replies.take(0.2) is not None:
                assert time.monotonic() < deadline
                bus.request("prepare", PrepareRequest(world_id="abc"), replies, **W0)
            killed_at = time.monotonic_ns()
            with kept_waiting() as kept:
                member.kill()
                gone, reply = take(alive), take(replies)

    assert not gone.up
    assert gone.received_mono_ns - killed_at < (1.0 + kept.seconds) * 1e9
    assert reply.error == "no answer"
    assert reply.received_mono_ns - killed_at < (1.0 + kept.seconds) * 1e9


def test_clients_find_a_router_that_was_killed_and_started_again() -> None:
    setup = BusSetup(endpoint=free_endpoint())
    mailbox, alive = Mailbox(10), Mailbox(10)
    with ExitStack() as stack:
        router = stack.enter_context(python("-c", ROUTER, setup.endpoint))
        sender = stack.enter_context(ZenohBus(setup))
        receiver = stack.enter_context(ZenohBus(setup))
        receiver.subscribe("speed", mailbox, vehicle="ego")
        receiver.watch_alive(alive_key(run="r1", process="*"), alive)
        sender.declare_alive(alive_key(**W0))
        publish_until_received(sender, mailbox)
        assert take(alive).up

        router.kill()
        assert not take(alive).up
        sender.publish("speed", SpeedSample(stamp_ns=1, speed_mps=1.0), vehicle="ego")
        stack.enter_context(python("-c", ROUTER, setup.endpoint))

        publish_until_received(sender, mailbox)
        assert take_until(alive, lambda item: item.up).key == alive_key(**W0)


def test_a_lossless_bus_waits_for_a_slow_reader() -> None:
    count = 2000
    mailbox = Mailbox(1, when_full="block")
    with zenoh_sides(lossless=True) as sides:
        sides.far.subscribe("speed", mailbox, vehicle="ego")
        publish_until_received(sides.near, mailbox)
        for n in range(100):
            sides.near.publish("speed", SpeedSample(stamp_ns=n, speed_mps=0.0), vehicle="ego")
        stamps = [take(mailbox).message().stamp_ns for _ in range(100)]
        for n in range(100, count):
            sides.near.publish("speed", SpeedSample(stamp_ns=n, speed_mps=0.0), vehicle="ego")
            stamps.append(take(mailbox).message().stamp_ns)
        mailbox.close()

    assert stamps == list(range(count))


def test_a_lossless_bus_waits_for_a_reader_that_stands_still() -> None:
    """Zenoh would close the link after 5 s, and lose what is on its way."""
    lossless, live = (
        zenoh_config(BusSetup(endpoint="tcp/127.0.0.1:1", lossless=lossless), router=False)
        for lossless in (True, False)
    )
    close_us = "transport/link/tx/queue/congestion_control/block/wait_before_close"
    for setting, least in ((close_us, 300_000_000), ("transport/link/tx/lease", 60_000)):
        assert int(live.get_json(setting)) < least <= int(lossless.get_json(setting))


def test_a_question_that_is_never_answered_times_out() -> None:
    questions, replies = Mailbox(10), Mailbox(10)
    with zenoh_sides() as sides:
        sides.far.serve("prepare", questions, **W0)
        ask_until_served(sides, questions, replies, tag=0).refuse("met")
        assert take(replies).error == "met"

        sides.near.request("prepare", PrepareRequest(world_id="a"), replies, timeout_s=0.5, **W0)
        question, reply = take(questions), take(replies)
        question.refuse("too late")

        assert reply.message is None
        assert "timeout" in reply.error.lower()
        assert replies.take(0.2) is None


def test_no_router_is_one_clear_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("foretwin.contracts.zenoh_config.CONNECT_S", 0.5)
    endpoint = free_endpoint()

    with pytest.raises(BusUnreachable, match=f"no Zenoh router at {endpoint}"):
        ZenohBus(BusSetup(endpoint=endpoint))


def test_closing_twice_is_harmless_and_ends_receiving() -> None:
    with zenoh_sides() as sides:
        mailbox = Mailbox(10)
        sides.far.subscribe("speed", mailbox, vehicle="ego")
        publish_until_received(sides.near, mailbox)
        sides.far.close()
        sides.far.close()

        sides.near.publish("speed", SpeedSample(stamp_ns=1, speed_mps=1.0), vehicle="ego")

        assert mailbox.take(0.2) is None


def test_a_process_that_is_there_again_before_its_end_is_seen_stays_there() -> None:
    setup = BusSetup(endpoint=free_endpoint())
    tokens = Mailbox(10)
    with ZenohBus(setup, router=True) as bus:
        bus.watch_alive(alive_key(run="r1", process="*"), tokens)
        with ZenohBus(setup) as successor:
            with ZenohBus(setup) as before:
                before.declare_alive(alive_key(**W0))
                assert take(tokens).up
                successor.declare_alive(alive_key(**W0))
                again = take(tokens)
                assert (again.key, again.up) == (alive_key(**W0), True)
            successor.declare_alive(alive_key(run="r1", process="w1"))
            assert take(tokens).key.endswith("/w1")
        assert {take(tokens).up, take(tokens).up} == {False}
