"""A mailbox is bounded, counts what it forgets, and never keeps anyone waiting after it closed."""

from __future__ import annotations

import threading
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.contracts.drive import SpeedSample
from foretwin.contracts.mailbox import Mailbox, Received, Reply
from tests.contracts.bus_sides import DEADLINE_S


@given(depth=st.integers(1, 20), count=st.integers(0, 60))
def test_a_full_mailbox_forgets_the_oldest_and_counts_it(depth: int, count: int) -> None:
    mailbox = Mailbox(depth)
    for item in range(count):
        mailbox.put(item)

    kept = min(depth, count)

    assert len(mailbox) == kept
    assert [mailbox.take() for _ in range(kept)] == list(range(count - kept, count))
    assert mailbox.dropped == count - kept
    assert mailbox.take() is None


def test_a_blocking_mailbox_makes_the_writer_wait_and_loses_nothing() -> None:
    mailbox = Mailbox(2, when_full="block")
    writer = threading.Thread(target=lambda: [mailbox.put(item) for item in range(100)])
    writer.start()

    taken = [mailbox.take(DEADLINE_S) for _ in range(100)]
    writer.join(DEADLINE_S)

    assert taken == list(range(100))
    assert mailbox.dropped == 0
    assert not writer.is_alive()


def test_many_writers_lose_nothing_while_there_is_room() -> None:
    mailbox = Mailbox(4000)
    writers = [
        threading.Thread(target=lambda n=n: [mailbox.put((n, i)) for i in range(1000)])
        for n in range(4)
    ]
    for writer in writers:
        writer.start()

    taken = [mailbox.take(DEADLINE_S) for _ in range(4000)]

    for n in range(4):
        assert [i for writer, i in taken if writer == n] == list(range(1000))
    assert mailbox.dropped == 0


def received(channel: str = "speed") -> Received:
    return Received(channel, f"foretwin/v1/vehicle/ego/telemetry/{channel}", b"", SpeedSample)


def test_messages_gather_until_an_answer_or_a_question_comes() -> None:
    mailbox = Mailbox(8)
    gathered = threading.Event()

    def gather() -> None:
        mailbox.gather(DEADLINE_S)
        gathered.set()

    reader = threading.Thread(target=gather)
    reader.start()
    mailbox.put(received())
    assert not gathered.wait(0.05)
    mailbox.put(Reply("job", None, None, "no answer", 0))
    assert gathered.wait(DEADLINE_S)
    reader.join(DEADLINE_S)
    assert len(mailbox) == 2


def test_nothing_gathers_while_an_answer_waits_and_samples_do_for_so_long_alone() -> None:
    mailbox = Mailbox(2)
    mailbox.put(Reply("job", None, None, "no answer", 0))
    began_s = time.monotonic()
    mailbox.gather(DEADLINE_S)
    assert time.monotonic() - began_s < DEADLINE_S
    mailbox.put(received())
    mailbox.put(received())  # the answer is the oldest, and forgotten
    mailbox.gather(0.01)
    assert time.monotonic() - began_s > 0.01
    mailbox.close()
    mailbox.gather(DEADLINE_S)
    assert time.monotonic() - began_s < DEADLINE_S


def test_who_waits_at_one_mailbox_goes_on_as_something_comes_to_another() -> None:
    inbox = Mailbox(8)
    views = Mailbox(8, nudges=inbox)
    went_on = threading.Event()

    def wait() -> None:
        assert inbox.take(DEADLINE_S) is None
        went_on.set()

    reader = threading.Thread(target=wait)
    reader.start()
    views.put(received())
    assert went_on.wait(DEADLINE_S / 2)
    reader.join(DEADLINE_S)
    assert (len(inbox), len(views)) == (0, 1)
    began_s = time.monotonic()
    assert inbox.take(0.02) is None, "a nudge counts once"
    assert time.monotonic() - began_s > 0.019


def test_a_nudge_before_the_wait_counts_and_keeps_nothing_back() -> None:
    mailbox = Mailbox(8)
    mailbox.nudge()
    began_s = time.monotonic()
    assert mailbox.take(DEADLINE_S) is None
    assert time.monotonic() - began_s < DEADLINE_S / 2
    mailbox.put("sample")
    mailbox.nudge()
    assert mailbox.take(DEADLINE_S) == "sample"


def test_take_waits_for_the_next_item() -> None:
    mailbox = Mailbox(1)
    reader_ready = threading.Event()

    def write() -> None:
        reader_ready.wait(DEADLINE_S)
        mailbox.put("late")

    writer = threading.Thread(target=write)
    writer.start()
    assert mailbox.take() is None
    reader_ready.set()

    assert mailbox.take(None) == "late"
    writer.join(DEADLINE_S)


def test_the_last_item_is_waited_for_and_then_there_is_none() -> None:
    mailbox = Mailbox(1)
    writer = threading.Timer(0.02, mailbox.put, ("late",))
    writer.start()

    assert mailbox.take_last(DEADLINE_S) == "late"
    assert mailbox.take_last(0.01) is None
    writer.join()


def test_closing_wakes_reader_and_writer() -> None:
    full, empty = Mailbox(1, when_full="block"), Mailbox(1)
    full.put("first")
    taken: list[object] = []
    threads = [
        threading.Thread(target=lambda: full.put("second")),
        threading.Thread(target=lambda: taken.append(empty.take(None))),
    ]
    for thread in threads:
        thread.start()

    full.close()
    empty.close()
    for thread in threads:
        thread.join(DEADLINE_S)

    assert not any(thread.is_alive() for thread in threads)
    assert taken == [None]
    assert full.take() == "first"
    assert full.take() is None
    full.put("third")
    assert len(full) == 0


def test_a_mailbox_without_room_is_refused() -> None:
    with pytest.raises(ValueError, match="depth 0"):
        Mailbox(0)


def test_what_was_too_large_to_be_kept_is_of_nobodys_numbering() -> None:
    assert Received("speed", "a/b", None, SpeedSample).sender == 0
