"""Tasks on a bus in memory: answers, refusals, deadlines, and workers that say nothing."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from foretwin.contracts.bus import Mailbox, Reply, Request
from foretwin.contracts.runner import Answer, Task
from foretwin.contracts.simulation import PrepareReply, PrepareRequest
from foretwin.orchestrator.runner import bus_dispatcher
from foretwin.orchestrator.runner.bus_dispatcher import LONGEST_S, NO_ANSWER, BusDispatcher
from foretwin.orchestrator.runner.sickness import FIRST_PAUSE_S
from tests.contracts.memory_bus import MemoryBus

A = Task("a", "prepare", "w", PrepareRequest(world_id="a"))


class Bench:
    """A dispatcher with one worker `w0` that a test lets answer, and a clock that it moves."""

    def __init__(self) -> None:
        self.now_s = 100.0
        self.bus, self.mailbox, self.asked = MemoryBus(), Mailbox(16), Mailbox(16)
        self.bus.serve("prepare", self.asked, run="r1", process="w0")
        self.dispatcher = BusDispatcher(self.bus, self.mailbox, run_id="r1", expected=["w0", "w1"])
        self.dispatcher.worker_up("w0")

    def question(self) -> Request:
        self.dispatcher.give_out()
        found = self.asked.take()
        assert isinstance(found, Request)
        return found

    def reply(self) -> list[Answer]:
        found = self.mailbox.take()
        assert isinstance(found, Reply)
        return self.dispatcher.reply(found)


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Bench:
    made = Bench()
    monkeypatch.setattr(bus_dispatcher, "time", SimpleNamespace(monotonic=lambda: made.now_s))
    return made


def test_an_answer_comes_with_its_task_and_who_gave_it(bench: Bench) -> None:
    bench.dispatcher.submit(A)
    message = PrepareReply(world_id="a", worker_id="w0", seconds=1.0)
    bench.question().reply(message)
    (answer,) = bench.reply()
    assert (answer.task, answer.message, answer.failure) == (A, message, "")
    assert (answer.worker_id, answer.received_mono_ns > 0) == ("w0", True)


def test_a_refusal_is_the_reason_once_nobody_is_left_to_ask(bench: Bench) -> None:
    bench.dispatcher.submit(A)
    bench.question().refuse("no path")
    assert bench.reply() == []
    bench.now_s += 1e6
    bench.dispatcher.give_out()
    assert bench.asked.take() is None
    assert bench.dispatcher.expect(["w0"]) == [Answer(A, None, "no path")]


def test_a_worker_that_refused_is_asked_for_others_when_its_pause_is_over(bench: Bench) -> None:
    bench.dispatcher.submit(A)
    bench.question().refuse("no path")
    bench.reply()
    bench.bus.serve("prepare", Mailbox(16), run="r1", process="w1")
    bench.dispatcher.worker_up("w1")
    bench.dispatcher.give_out()  # the other has it now
    other = A._replace(key="b")
    bench.dispatcher.submit(other)
    bench.dispatcher.give_out()
    assert bench.asked.take() is None
    bench.now_s += FIRST_PAUSE_S
    bench.question().reply(PrepareReply(world_id="a", worker_id="w0", seconds=1.0))
    assert [answer.task for answer in bench.reply()] == [other]


def test_a_deadline_finds_what_all_that_are_up_have_refused(bench: Bench) -> None:
    bench.dispatcher.submit(A, within_s=10.0)
    assert bench.dispatcher.without_takers("a") == []
    bench.question().refuse("no path")
    bench.reply()
    assert bench.dispatcher.without_takers("a") == [Answer(A, None, "no path")]


def test_a_task_that_is_not_answered_by_its_deadline_is_given_up(bench: Bench) -> None:
    bench.dispatcher.submit(A, within_s=10.0)
    question = bench.question()
    bench.now_s += 10.0
    question.refuse("Timeout")
    assert bench.reply() == [Answer(A, None, "no answer in 10 s")]
    # The worker is slow and not dead: it takes what comes next.
    bench.dispatcher.submit(A)
    assert bench.question().message().world_id == "a"


def test_who_says_nothing_is_asked_again_when_it_can_be_known_to_live(bench: Bench) -> None:
    bench.dispatcher.submit(A)
    bench.question().refuse(NO_ANSWER)
    assert bench.reply() == []
    bench.dispatcher.give_out()
    assert bench.asked.take() is None
    bench.now_s += 1.0
    assert bench.question().message().world_id == "a"


def test_what_a_task_that_killed_its_workers_comes_to_is_an_answer(bench: Bench) -> None:
    bench.dispatcher.submit(A)
    for _ in range(2):
        bench.question()
        assert bench.dispatcher.worker_down("w0", how="signal 9") == []
        bench.dispatcher.worker_up("w0")
    bench.question()
    (lost,) = bench.dispatcher.worker_down("w0", how="signal 9")
    assert lost == Answer(A, None, "3 workers died of it, the last by signal 9")


def test_a_far_worker_that_answers_nothing_at_once_is_asked_once_until_it_is_heard(
    bench: Bench,
) -> None:
    """What zenoh#2767 does to a queryable whose link came back: no loop, and others go on."""
    dispatcher, far = bench.dispatcher, bench.dispatcher.dispatch.far
    dispatcher.worker_down("w0")
    dispatcher.expect(["w-a-0", "w1"])
    dispatcher.worker_up("w-a-0")
    far.join("w-a-0", work_s=0.0, link_s=0.0)
    far.has_world("w-a-0", "w")
    dispatcher.submit(A)
    asked = 0
    for _ in range(100):
        bench.now_s += 0.01
        dispatcher.give_out()
        while isinstance(reply := bench.mailbox.take(), Reply):
            assert reply.error == NO_ANSWER
            asked += 1
            assert dispatcher.reply(reply) == []
    assert asked == 1
    far.heard("w-a-0", 0.001)
    dispatcher.give_out()
    assert isinstance(bench.mailbox.take(), Reply)


@pytest.mark.parametrize(("given", "longest_s"), [({}, LONGEST_S), ({"longest_s": 5.0}, 5.0)])
def test_the_bus_remembers_no_question_for_ever(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, given: dict[str, float], longest_s: float
) -> None:
    waits: list[float] = []
    monkeypatch.setattr(bench.bus, "request", lambda *_, timeout_s, **__: waits.append(timeout_s))
    asks = BusDispatcher(bench.bus, bench.mailbox, run_id="r1", expected=["w0"], **given)
    asks.worker_up("w0")
    asks.submit(A)
    asks.give_out()
    assert waits == [pytest.approx(longest_s, abs=0.02)]

    (question,) = asks.dispatch.busy.values()
    asks.reply(Reply("prepare", ("w0", question), None, NO_ANSWER, 0))
    bench.now_s += 1.0
    asks.give_out()
    assert len(waits) == 2  # It is asked for again, not given up.
    assert LONGEST_S <= 3600.0
