"""Tasks that a cluster answers: each ends once, its World is at hand, nothing waits for ever."""

from __future__ import annotations

import threading
import time
from collections import Counter
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.contracts.codec import encode
from foretwin.contracts.errors import UserError
from foretwin.contracts.runner import answers
from foretwin.contracts.simulation import PrepareReply, PrepareRequest
from foretwin.orchestrator.runner import ray_runner
from foretwin.orchestrator.runner.ray_runner import Ended
from foretwin.orchestrator.runner.worker_processes import NoWorkerError
from foretwin.sim_worker.seat import SeatQuestion
from tests.orchestrator.runner.one_by_one import OneByOne, counted, on, task


def test_an_answer_is_a_message_and_names_its_seat() -> None:
    cluster = OneByOne()
    runner = on(cluster)
    runner.submit(task("a"))
    assert runner.take() is None
    cluster.end()
    answer = runner.take()
    assert answer is not None
    assert (answer.task.key, answer.failure, answer.worker_id) == ("a", "", "n1-0")
    assert isinstance(answer.message, PrepareReply)
    assert runner.take(None) is None
    assert counted(runner) == (1, 1, 0, 0)


def test_what_cannot_be_answered_says_why_and_is_counted_as_what_it_is() -> None:
    cluster = OneByOne()
    runner = on(cluster)
    for key in "refused", "late", "died", "garbage", "another kind":
        runner.submit(task(key))
    cluster.end(refusal="ValueError: no", data=b"")
    cluster.end(refusal="no answer in 60 s", data=b"", late=True)
    cluster.lose("3 workers died of it")
    cluster.end(data=b"\xc1 garbage")
    cluster.end(data=encode(PrepareRequest(world_id="A")))
    told = {answer.task.key: answer.failure for answer in iter(runner.take, None)}
    assert told["refused"] == "ValueError: no"
    assert told["late"] == "no answer in 60 s"
    assert told["died"] == "3 workers died of it"
    assert told["garbage"].startswith("Refused: prepare of n1-0: ")
    assert told["another kind"].startswith("Refused: prepare of n1-0: ")
    assert counted(runner) == (5, 0, 3, 2)


def test_a_node_with_other_versions_ends_it_all_in_one_line() -> None:
    cluster = OneByOne()
    runner = on(cluster)
    runner.submit(task("a"))
    cluster.end(strange="n7 has numpy 1.0 instead of 2.4", data=b"")
    with pytest.raises(UserError, match=r"n7 has numpy 1.0 instead of 2.4: install there what is"):
        runner.take()


def test_a_world_is_stored_once_and_comes_with_each_question_about_it() -> None:
    cluster = OneByOne()
    runner = on(cluster)
    for key, world in (("1", "A"), ("2", "B"), ("3", "A")):
        runner.submit(task(key, world, "job"))
    assert [(question.world_id, world) for question, world, _ in cluster.asked] == [
        ("A", b"A"),
        ("B", b"B"),
        ("A", b"A"),
    ]
    assert cluster.stored == [b"A", b"B"]
    runner.submit(task("4", "C"))  # a channel that is about no World of the folder
    assert cluster.asked[-1][1] is None


def test_worlds_that_nobody_is_asked_about_leave_the_store(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(ray_runner, "_KEPT_WORLDS", 1)
    cluster = OneByOne()
    runner = on(cluster)
    for world in "ABCA":
        runner.submit(task(world, world, "place"))
        cluster.end()
        runner.take()
    assert cluster.stored == [b"A", b"B", b"C", b"A"]
    assert list(runner._worlds) == ["A"]


def test_a_world_that_is_lost_costs_its_own_task_alone() -> None:
    def file(name: str) -> bytes:
        if name == "lost":
            raise FileNotFoundError(2, "No such file", "lost.world")
        return b""

    cluster = OneByOne()
    runner = on(cluster, world_file=file)
    runner.submit(task("1", "lost", "job"))
    runner.submit(task("2", "A", "job"))
    answer = runner.take()
    assert answer is not None
    assert "lost.world" in answer.failure
    cluster.end()
    assert runner.take() is not None
    assert counted(runner) == (2, 1, 1, 0)


def test_no_more_than_wanted_are_with_the_cluster_at_once() -> None:
    cluster = OneByOne("n1-0", "n1-1", "n2-0")
    runner = on(cluster, most=2)
    assert (runner.capacity, on(cluster).capacity, on(cluster, most=9).capacity) == (2, 3, 3)
    for key in "abc":
        runner.submit(task(key))
    assert len(cluster.asked) == 2
    cluster.end()
    assert runner.take() is not None
    assert len(cluster.asked) == 2


def test_what_is_cancelled_does_not_count_and_makes_room() -> None:
    cluster = OneByOne()
    runner = on(cluster, most=1)
    for key in "abc":
        runner.submit(task(key))
    runner.cancel("b")  # waits
    runner.cancel("a")  # is with the cluster, which may answer nevertheless
    assert cluster.forgotten == 1
    cluster.end()
    assert runner.take() is None
    cluster.end()
    answer = runner.take()
    assert answer is not None
    assert answer.task.key == "c"
    runner.cancel("c")
    assert counted(runner) == (3, 1, 0, 2)


def test_a_key_that_was_cancelled_may_come_again() -> None:
    cluster = OneByOne()
    runner = on(cluster)
    runner.submit(task("a"))
    with pytest.raises(ValueError, match="submitted twice"):
        runner.submit(task("a"))
    runner.cancel("a")
    runner.submit(task("a"))
    cluster.end()  # the answer to the first one
    assert runner.take() is None
    cluster.end()
    assert runner.take() is not None
    assert counted(runner) == (2, 1, 0, 1)


def test_who_waits_for_ever_waits_no_longer_than_a_cluster_without_processors_may_take(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(ray_runner, "_LOOK_S", 0.01)
    cluster = OneByOne()
    runner = on(cluster, task_timeout_s=0.05)
    cluster.names = ()
    runner.submit(task("a"))
    with pytest.raises(NoWorkerError, match=r"has had no processor for 0.05 s"):
        runner.take(None)
    cluster.names = ("n1-0",)
    with pytest.raises(NoWorkerError, match=r"has answered anything in 0.2 s"):
        runner.take(None)


def test_after_a_node_is_gone_the_eldest_are_asked_once_more_and_count_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(ray_runner, "_LOOK_S", 0.0)
    cluster = OneByOne("n1-0", "n2-0")
    runner = on(cluster)
    for key in "abc":
        runner.submit(task(key, key, "job"))
    cluster.lost_s = time.monotonic()
    assert runner.take() is None
    assert len(cluster.asked) == 3  # Ray may be at it
    monkeypatch.setattr(ray_runner, "_AGAIN_S", 0.0)
    runner.submit(task("d"))  # after that
    for _ in range(2):
        assert runner.take() is None
        assert "".join(question.world_id for question, *_ in cluster.asked) == "abcAab"
    cluster.end(4)
    cluster.end(0)
    answer = runner.take()
    assert answer is not None
    assert answer.task.key == "a"
    assert runner.take() is None  # the other answer to it; c is among the eldest now
    assert "".join(question.world_id for question, *_ in cluster.asked) == "bcAbc"
    runner.cancel("b")
    assert cluster.forgotten == 2
    for _ in range(4):
        cluster.end()
    assert len(list(iter(runner.take, None))) == 2
    assert counted(runner) == (4, 3, 0, 1)


def test_of_one_that_was_asked_twice_the_loss_of_one_half_is_not_the_end(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(ray_runner, "_LOOK_S", 0.0)
    monkeypatch.setattr(ray_runner, "_AGAIN_S", 0.0)
    cluster = OneByOne("n1-0")
    runner = on(cluster)
    runner.submit(task("a"))
    cluster.lost_s = time.monotonic()
    assert runner.take() is None
    assert len(cluster.asked) == 2
    cluster.lose("3 workers died of it")
    assert runner.take() is None
    assert len(cluster.asked) == 1, "twice is enough"
    cluster.end()
    assert [one.failure for one in iter(runner.take, None)] == [""]
    assert counted(runner) == (1, 1, 0, 0)


def test_an_answer_wakes_who_waits_for_it() -> None:
    cluster = OneByOne()
    runner = on(cluster)
    runner.submit(task("a"))
    threading.Timer(0.05, cluster.end).start()
    assert runner.take(None) is not None


def test_what_seats_have_to_say_goes_to_the_log() -> None:
    told: list[bytes] = []
    cluster = OneByOne()
    runner = on(cluster, log=told.append)
    runner.submit(task("a"))
    cluster.end(log=(b"one", b"two"))
    runner.take()
    assert told == [b"one", b"two"]


@given(
    steps=st.lists(
        st.sampled_from(["submit", "cancel", "answer", "refuse", "lose", "take"]), max_size=40
    ),
    most=st.sampled_from([None, 1, 2]),
    pick=st.randoms(use_true_random=False),
)
def test_whatever_happens_each_task_ends_once(
    steps: list[str], most: int | None, pick: Any
) -> None:
    cluster = OneByOne()
    runner, ended, cancelled = on(cluster, most=most), Counter[str](), Counter[str]()
    submitted = 0

    def take() -> None:
        while (answer := runner.take()) is not None:
            ended[answer.task.key] += 1

    acts: dict[str, Callable[[], object]] = {
        "answer": lambda: cluster.end(pick.randrange(len(cluster.asked))),
        "refuse": lambda: cluster.end(refusal="no", data=b""),
        "lose": lambda: cluster.lose("gone"),
    }
    for step in steps:
        if step == "submit":
            runner.submit(task(str(submitted), pick.choice("AB"), "job"))
            submitted += 1
        elif step == "cancel" and submitted:
            key = str(pick.randrange(submitted))
            before = runner.count.lost
            runner.cancel(key)
            cancelled[key] += runner.count.lost - before
        elif step == "take":
            take()
        elif step in acts and cluster.asked:
            acts[step]()
    take()
    while cluster.asked:
        cluster.end()
        take()
    assert ended + cancelled == Counter({str(n): 1 for n in range(submitted)})
    given_, *ends = counted(runner)
    assert given_ == submitted == sum(ends)
    assert all(not count for count in runner._asked_of.values())


def test_all_of_many_are_answered_by_a_cluster_that_answers_at_once() -> None:
    class AtOnce(OneByOne):
        def ask(self, question: SeatQuestion, world: Any | None, **more: Any) -> Future[Ended]:
            ended = super().ask(question, world, **more)
            self.end()
            return ended

    tasks = [task(str(n), "A", "job") for n in range(600)]
    found = list(answers(on(AtOnce()), tasks, ahead=256))
    assert sorted(int(one.task.key) for one in found) == list(range(600))
