"""Nothing is lost with a worker, nothing counts twice, nothing is tried for ever."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.contracts.runner import Task
from foretwin.contracts.simulation import PrepareRequest
from foretwin.orchestrator.runner.dispatch import ATTEMPTS, Dispatch


def task(key: str, world_id: str = "w") -> Task:
    return Task(key, "job", world_id, PrepareRequest(world_id=world_id))


def begun(*keys: str, workers: int = 2, in_flight: int = 1, refusals: int = 1) -> Dispatch:
    """Tasks `world:number` or mere keys, submitted to workers that are up."""
    dispatch = Dispatch(in_flight=in_flight, refusals=refusals)
    for number in range(workers):
        dispatch.worker_up(f"w{number}")
    for key in keys:
        dispatch.submit(task(key, key.split(":", 1)[0] if ":" in key else "w"))
    return dispatch


def given_out(dispatch: Dispatch) -> list[tuple[str, str]]:
    return [(one.worker_id, one.task.key) for one in dispatch.assignments()]


def test_idle_workers_are_given_the_oldest_tasks() -> None:
    dispatch = begun("a", "b", "c")
    assert given_out(dispatch) == [("w0", "a"), ("w1", "b")]
    assert dispatch.answered("w1", "b")
    assert given_out(dispatch) == [("w1", "c")]


def test_a_dead_workers_task_goes_to_another_and_counts_once() -> None:
    dispatch = begun("a", "b")
    given_out(dispatch)
    assert dispatch.worker_down("w0") == []
    assert given_out(dispatch) == []
    assert dispatch.answered("w1", "b")
    assert given_out(dispatch) == [("w1", "a")]
    assert dispatch.answered("w1", "a")
    # What the dead worker had sent before it died arrives after all.
    assert not dispatch.answered("w0", "a")
    assert (dispatch.late, dispatch.requeued, dispatch.open) == (1, 1, 0)


def test_an_answer_from_before_the_death_counts_and_is_not_asked_for_again() -> None:
    dispatch = begun("a", workers=1)
    given_out(dispatch)
    dispatch.worker_down("w0")
    assert dispatch.answered("w0", "a")
    dispatch.worker_up("w0")
    assert given_out(dispatch) == []


def test_a_task_of_which_workers_die_is_given_up_and_named() -> None:
    dispatch = begun("a", "b", workers=1)
    for _ in range(ATTEMPTS - 1):
        assert given_out(dispatch) == [("w0", "a")]
        assert dispatch.worker_down("w0", how="signal 9") == []
        dispatch.worker_up("w0")
    given_out(dispatch)
    ((lost, reason),) = dispatch.worker_down("w0", how="signal 9")
    assert (lost.key, reason) == ("a", "3 workers died of it, the last by signal 9")
    dispatch.worker_up("w0")
    assert given_out(dispatch) == [("w0", "b")]


def test_only_what_a_worker_was_at_has_cost_its_life() -> None:
    dispatch = begun("deadly", "b", "c", workers=1, in_flight=2)
    for _ in range(ATTEMPTS):
        assert given_out(dispatch) == [("w0", "deadly"), ("w0", "b")]
        lost = dispatch.worker_down("w0")
        dispatch.worker_up("w0")
    assert [one.task.key for one in lost] == ["deadly"]
    assert given_out(dispatch) == [("w0", "b"), ("w0", "c")]


def test_a_task_that_is_refused_is_tried_elsewhere_so_often_and_then_given_up() -> None:
    dispatch = begun("a", workers=1, refusals=3)
    for _ in range(2):
        assert given_out(dispatch) == [("w0", "a")]
        assert dispatch.refused("w0", "a", "no path") == []
    given_out(dispatch)
    (lost,) = dispatch.refused("w0", "a", "no path")
    assert (lost.task.key, lost.reason) == ("a", "no path")
    assert dispatch.open == 0


def test_who_leaves_a_question_unanswered_gets_it_again_once_it_is_known_to_live() -> None:
    dispatch = begun("a", "b", workers=1)
    for _ in range(20):
        assert given_out(dispatch) == [("w0", "a")]
        dispatch.unanswered("w0", "a")
        assert given_out(dispatch) == []
        dispatch.trust("w0")
    assert dispatch.open == 2


def test_who_leaves_a_question_unanswered_and_is_dead_has_died_of_it() -> None:
    dispatch = begun("a", workers=1)
    for _ in range(ATTEMPTS):
        given_out(dispatch)
        dispatch.unanswered("w0", "a")
        lost = dispatch.worker_down("w0")
        dispatch.worker_up("w0")
    assert [one.task.key for one in lost] == ["a"]


def test_a_cancelled_task_is_not_begun_and_its_answer_is_late() -> None:
    dispatch = begun("a", "b", workers=1)
    given_out(dispatch)
    dispatch.cancel("a")
    dispatch.cancel("b")
    dispatch.submit(task("c"))
    assert given_out(dispatch) == []  # still at work
    assert not dispatch.answered("w0", "a")
    assert given_out(dispatch) == [("w0", "c")]


def test_a_key_is_open_once() -> None:
    dispatch = begun("a")
    with pytest.raises(ValueError, match="a is submitted twice"):
        dispatch.submit(task("a"))


def test_workers_keep_to_their_worlds() -> None:
    dispatch = begun("A:1", "A:2", "A:3", "B:1", "B:2")
    assert given_out(dispatch) == [("w0", "A:1"), ("w1", "B:1")]
    dispatch.answered("w1", "B:1")
    assert given_out(dispatch) == [("w1", "B:2")]
    dispatch.answered("w1", "B:2")
    dispatch.answered("w0", "A:1")
    # Nothing is left of its World: it helps with another's.
    assert given_out(dispatch) == [("w0", "A:2"), ("w1", "A:3")]


def test_a_worker_holds_two_tasks_while_enough_wait_and_no_other_lacks_them_at_the_end() -> None:
    dispatch = begun(*"abcdef", in_flight=2)
    assert given_out(dispatch) == [("w0", "a"), ("w1", "b"), ("w0", "c"), ("w1", "d")]
    dispatch.answered("w0", "a")
    assert given_out(dispatch) == [("w0", "e")]
    dispatch.answered("w0", "c")
    assert given_out(dispatch) == []
    dispatch.answered("w0", "e")
    assert given_out(dispatch) == [("w0", "f")]


_EVENTS = [f"{what}{number}" for what in ("die", "back", "answer", "silent") for number in "01"]


@given(st.lists(st.sampled_from(_EVENTS)), st.sampled_from([1, 2]))
def test_no_order_of_deaths_loses_or_doubles_a_task(events: list[str], in_flight: int) -> None:
    dispatch = begun(*"abcdef", in_flight=in_flight)
    at_work: dict[str, list[str]] = {"w0": [], "w1": []}
    ended: list[str] = []

    def give() -> None:
        for worker_id, key in given_out(dispatch):
            at_work[worker_id].append(key)

    give()
    ends = ["back0", "back1", *["answer0", "answer1"] * 6]
    for event in [*events, *ends]:
        what, worker_id = event[:-1], f"w{event[-1]}"
        if what == "silent" and at_work[worker_id]:
            dispatch.unanswered(worker_id, at_work[worker_id].pop())
        elif what in ("die", "back"):
            at_work[worker_id] = []
            call = dispatch.worker_down if what == "die" else dispatch.worker_up
            ended += [one.task.key for one in call(worker_id)]
        elif what == "answer" and at_work[worker_id]:
            key = at_work[worker_id].pop(0)
            ended += [key] if dispatch.answered(worker_id, key) else []
        give()
    assert sorted(ended) == list("abcdef")
    assert dispatch.open == 0
