"""The bus in memory and the bus over Zenoh keep the same promises."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import pytest

from foretwin.contracts.bus import Alive, Mailbox, Reply, ask
from foretwin.contracts.codec import SchemaMismatch
from foretwin.contracts.drive import SpeedSample
from foretwin.contracts.keys import alive_key
from foretwin.contracts.simulation import PrepareReply, PrepareRequest
from tests.contracts.bus_sides import (
    DEADLINE_S,
    Sides,
    ask_until_served,
    memory_sides,
    publish_until_received,
    take,
    take_until,
    zenoh_sides,
)

COVERS = ("foretwin.contracts.bus_calls",)

W0 = {"run": "r1", "process": "w0"}
PREPARE = PrepareRequest(world_id="abc")


@pytest.fixture(params=["memory", "zenoh"])
def sides(request: pytest.FixtureRequest) -> Iterator[Sides]:
    # Lossless: a live bus may drop of a burst, which is no promise to hold it to.
    with memory_sides() if request.param == "memory" else zenoh_sides(lossless=True) as both:
        yield both


def test_messages_arrive_in_order_and_numbered(sides: Sides) -> None:
    mailbox = Mailbox(100)
    sides.far.subscribe("speed", mailbox, vehicle="ego")
    first = publish_until_received(sides.near, mailbox).envelope()

    for n in range(50):
        sides.near.publish("speed", SpeedSample(stamp_ns=n, speed_mps=float(n)), vehicle="ego")
    envelopes = [take(mailbox).envelope() for _ in range(50)]

    assert [e.message.stamp_ns for e in envelopes] == list(range(50))
    assert all(b.seq == a.seq + 1 for a, b in itertools.pairwise(envelopes))
    assert all(b.sent_ns >= a.sent_ns > first.sent_ns for a, b in itertools.pairwise(envelopes))


def test_a_message_says_where_it_came_from(sides: Sides) -> None:
    mailbox = Mailbox(10)
    sides.far.subscribe("speed", mailbox, vehicle="*")

    item = publish_until_received(sides.near, mailbox, vehicle="truck")

    assert item.channel == "speed"
    assert item.key == "foretwin/v1/vehicle/truck/telemetry/speed"
    assert item.message() == SpeedSample(stamp_ns=0, speed_mps=-1.0)
    assert item.received_mono_ns > 0


def test_only_the_subscribed_vehicle_and_channel_arrive(sides: Sides) -> None:
    mailbox = Mailbox(100)
    sides.far.subscribe("speed", mailbox, vehicle="ego")
    publish_until_received(sides.near, mailbox)

    sides.near.publish("speed", SpeedSample(stamp_ns=1, speed_mps=1.0), vehicle="truck")
    sides.near.publish("speed", SpeedSample(stamp_ns=2, speed_mps=2.0), vehicle="ego")

    assert take(mailbox).message().stamp_ns == 2
    assert mailbox.take(0.2) is None


def test_a_question_is_answered_once_with_its_tag(sides: Sides) -> None:
    questions, replies = Mailbox(10), Mailbox(10)
    sides.far.serve("prepare", questions, **W0)

    question = ask_until_served(sides, questions, replies, tag="t1")
    assert question.message() == PREPARE
    question.reply(PrepareReply(world_id="abc", worker_id="w0", seconds=0.5))

    reply = take(replies)
    assert isinstance(reply, Reply)
    assert (reply.channel, reply.tag, reply.error) == ("prepare", "t1", None)
    assert reply.message == PrepareReply(world_id="abc", worker_id="w0", seconds=0.5)
    assert replies.take(0.2) is None


def test_a_refusal_carries_its_reason(sides: Sides) -> None:
    questions, replies = Mailbox(10), Mailbox(10)
    sides.far.serve("prepare", questions, **W0)

    ask_until_served(sides, questions, replies, tag=1).refuse("no World abc: the file is damaged")

    reply = take(replies)
    assert reply.message is None
    assert reply.error == "no World abc: the file is damaged"
    assert replies.take(0.2) is None


def test_a_question_that_its_server_forgets_ends_too(sides: Sides) -> None:
    questions, replies = Mailbox(1), Mailbox(10)
    sides.far.serve("prepare", questions, **W0)
    ask_until_served(sides, questions, replies, tag=0).refuse("met")
    assert take(replies).error == "met"

    for tag in ("first", "second"):
        sides.near.request("prepare", PREPARE, replies, tag=tag, timeout_s=DEADLINE_S, **W0)

    assert (reply := take(replies)).tag == "first"
    assert reply.error == "no answer"
    take(questions).refuse("too busy")
    assert take(replies)[:4] == ("prepare", "second", None, "too busy")


def test_nobody_there_is_an_answer_too(sides: Sides) -> None:
    replies = Mailbox(10)

    sides.near.request("prepare", PREPARE, replies, tag=7, timeout_s=DEADLINE_S, **W0)

    reply = take(replies)
    assert (reply.tag, reply.message, reply.error) == (7, None, "no answer")
    with pytest.raises(TimeoutError, match=r"worker/w0/prepare: no answer"):
        ask(sides.near, "prepare", PREPARE, timeout_s=DEADLINE_S, **W0)


def test_a_channel_without_replies_takes_no_questions(sides: Sides) -> None:
    speed = SpeedSample(stamp_ns=1, speed_mps=1.0)

    with pytest.raises(ValueError, match="'speed' takes no questions"):
        sides.near.request("speed", speed, Mailbox(1), vehicle="ego")


def test_an_answer_of_the_wrong_type_is_an_error(sides: Sides) -> None:
    questions, replies = Mailbox(10), Mailbox(10)
    sides.far.serve("prepare", questions, **W0)

    ask_until_served(sides, questions, replies, tag=1).reply(PREPARE)

    reply = take(replies)
    assert reply.message is None
    assert "no valid PrepareReply" in reply.error


def test_a_message_of_the_wrong_type_is_found_on_taking(sides: Sides) -> None:
    mailbox = Mailbox(10)
    sides.far.subscribe("speed", mailbox, vehicle="ego")
    publish_until_received(sides.near, mailbox)

    sides.near.publish("speed", PREPARE, vehicle="ego")

    with pytest.raises(SchemaMismatch, match="telemetry/speed: no valid SpeedSample"):
        take(mailbox).message()


def test_liveliness_tells_who_is_there_and_who_vanished(sides: Sides) -> None:
    before, after = Mailbox(10), Mailbox(10)
    token = alive_key(**W0)
    sides.near.watch_alive(alive_key(run="r1", process="*"), before)

    sides.far.declare_alive(token)
    up = take(before)
    sides.near.watch_alive(alive_key(run="r1", process="*"), after)
    already_up = take(after)
    sides.lose(token)

    assert isinstance(up, Alive)
    assert (up.key, up.up) == (already_up.key, already_up.up) == (token, True)
    for mailbox in (before, after):
        down = take_until(mailbox, lambda item: not item.up)
        assert down.key == token


def test_another_run_is_not_seen(sides: Sides) -> None:
    mailbox = Mailbox(10)
    sides.near.watch_alive(alive_key(run="r1", process="*"), mailbox)

    sides.far.declare_alive(alive_key(run="r2", process="w0"))
    sides.far.declare_alive(alive_key(run="r1", process="w1"))

    assert take(mailbox).key == alive_key(run="r1", process="w1")
    assert mailbox.take(0.2) is None
