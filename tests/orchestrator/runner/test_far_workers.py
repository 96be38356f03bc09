"""A far worker is given what it will answer in time; what it does not, a near one takes over."""

from __future__ import annotations

import pytest

from foretwin.orchestrator.runner.dispatch import Dispatch
from foretwin.orchestrator.runner.far_workers import LOOK_S, TAKES_OVER, FarWorkers
from tests.orchestrator.runner.test_dispatch import given_out, task

COVERS = ("foretwin.orchestrator.runner.open_tasks",)
NEAR_S = 0.1
LATEST_S = 0.5 - TAKES_OVER * NEAR_S - LOOK_S
"""Until when a task that is due at 0.5 s may stay with a far worker."""


def fleet(*, work_s: float = 0.05, link_s: float = 0.001, near: int = 1) -> Dispatch:
    """Near workers that take 0.1 s, and a far one that has World `w`."""
    dispatch = Dispatch()
    near_ids = [f"w{number}" for number in range(near)]
    dispatch.expect([*near_ids, "w-a-0"])
    for worker_id in [*near_ids, "w-a-0"]:
        dispatch.worker_up(worker_id)
    for number in range(near):
        dispatch.far.took(f"w{number}", NEAR_S, now_s=0.0)
    dispatch.far.join("w-a-0", work_s=work_s, link_s=link_s)
    dispatch.far.has_world("w-a-0", "w")
    return dispatch


def submit(dispatch: Dispatch, *keys: str, at_s: float = 0.0, world_id: str = "w") -> None:
    for key in keys:
        dispatch.submit(task(key, world_id), due_s=at_s + 0.5, span_s=0.5)


def test_the_fastest_of_the_idle_is_asked_first() -> None:
    fast, slow = fleet(work_s=0.05), fleet(work_s=0.2)
    for dispatch in (fast, slow):
        submit(dispatch, "a")
    assert given_out(fast) == [("w-a-0", "a")]
    assert given_out(slow) == [("w0", "a")]


def test_all_who_are_there_are_used() -> None:
    dispatch = fleet(work_s=0.2)
    submit(dispatch, "a", "b")
    assert given_out(dispatch) == [("w0", "a"), ("w-a-0", "b")]


def test_a_far_worker_without_the_world_is_given_nothing_of_it() -> None:
    dispatch = fleet()
    submit(dispatch, "a", world_id="other")
    assert given_out(dispatch) == [("w0", "a")]
    submit(dispatch, "b", world_id="other")
    assert given_out(dispatch) == []
    dispatch.far.has_world("w-a-0", "other")
    assert given_out(dispatch) == [("w-a-0", "b")]


@pytest.mark.parametrize(("link_s", "used"), [(0.02, True), (0.4, False)])
def test_a_link_too_slow_for_a_round_leaves_it_to_near_workers(link_s: float, used: bool) -> None:
    dispatch = fleet(link_s=link_s)
    submit(dispatch, "a", "b")
    assert (("w-a-0", "b") in given_out(dispatch) or "w-a-0" in dispatch.busy) is used


def test_answers_that_took_long_say_so_for_a_while() -> None:
    dispatch = fleet(near=2)
    dispatch.far.took("w-a-0", 0.45, now_s=1.0)
    submit(dispatch, "a", "b", "c", at_s=2.0)
    assert given_out(dispatch, now_s=2.0) == [("w0", "a"), ("w1", "b")]
    for worker_id, key in (("w0", "a"), ("w1", "b")):
        dispatch.answered(worker_id, key)
    dispatch.cancel("c")
    submit(dispatch, "d", at_s=20.0)
    assert given_out(dispatch, now_s=20.0) == [("w-a-0", "d")]


def test_what_is_not_answered_in_time_is_taken_over_and_counts_once() -> None:
    dispatch = fleet()
    submit(dispatch, "a")
    given_out(dispatch)
    dispatch.take_over(now_s=LATEST_S - 0.01)
    assert given_out(dispatch, now_s=LATEST_S - 0.01) == []
    dispatch.take_over(now_s=LATEST_S)
    assert given_out(dispatch, now_s=LATEST_S) == [("w0", "a")]
    assert dispatch.far.taken_over == 1
    assert dispatch.answered("w0", "a")
    assert not dispatch.answered("w-a-0", "a")
    assert (dispatch.count.given, dispatch.count.results, dispatch.late) == (1, 1, 1)


def test_a_far_answer_that_comes_first_after_all_counts() -> None:
    dispatch = fleet()
    submit(dispatch, "a")
    given_out(dispatch)
    dispatch.take_over(now_s=LATEST_S)
    given_out(dispatch, now_s=LATEST_S)
    assert dispatch.answered("w-a-0", "a")
    assert not dispatch.answered("w0", "a")


def test_who_owes_an_answer_is_given_nothing_before_it() -> None:
    dispatch = fleet()
    submit(dispatch, "a")
    given_out(dispatch)
    dispatch.take_over(now_s=LATEST_S)
    given_out(dispatch, now_s=LATEST_S)
    submit(dispatch, "b", at_s=0.5)
    assert given_out(dispatch, now_s=0.5) == []  # w0 is at a
    dispatch.answered("w-a-0", "a")
    assert given_out(dispatch, now_s=0.5) == [("w-a-0", "b")]


def test_near_workers_that_are_too_slow_are_no_refuge() -> None:
    """On a machine that needs longer than a round has, what is far is waited for to its end."""
    dispatch = fleet(work_s=0.3)
    for _ in range(8):
        dispatch.far.took("w0", 0.6, now_s=0.0)
    submit(dispatch, "a")
    assert given_out(dispatch) == [("w-a-0", "a")]
    dispatch.take_over(now_s=0.45)
    assert given_out(dispatch, now_s=0.45) == []


def test_one_that_was_not_heard_gets_nothing_until_it_is_and_begins_anew() -> None:
    dispatch = fleet(near=2)
    far = dispatch.far
    far.took("w-a-0", 0.45, now_s=0.0)
    far.take_back("w-a-0", "old")
    far.silent("w-a-0")
    assert far.is_silent("w-a-0")
    submit(dispatch, "a")
    assert given_out(dispatch) == [("w0", "a")]
    far.heard("w-a-0", 0.002)
    assert not far.is_silent("w-a-0")
    submit(dispatch, "b")
    assert given_out(dispatch) == [("w-a-0", "b")]


def test_what_is_near_goes_to_no_far_worker() -> None:
    dispatch = fleet()
    dispatch.submit(task("probe"), near=True)
    assert given_out(dispatch) == [("w0", "probe")]
    dispatch.submit(task("again"), near=True)
    assert given_out(dispatch) == []


def test_a_far_worker_that_is_gone_leaves_its_task_to_others() -> None:
    dispatch = fleet()
    submit(dispatch, "a")
    given_out(dispatch)
    dispatch.worker_down("w-a-0")
    dispatch.far.leave("w-a-0")
    assert given_out(dispatch) == [("w0", "a")]


def test_nothing_is_known_of_workers_where_none_is_far() -> None:
    """Then the order in which near ones are asked is that of their names, as ever."""
    far = FarWorkers()
    far.took("w0", 0.3, now_s=0.0)
    assert far.expected_s("w0", now_s=0.0) == far.expected_s("w1", now_s=0.0) == 0.0
    far.heard("w-b-0", 0.1)
    far.silent("w-b-0")
    far.answered("w-b-0", "a")
    assert not far
