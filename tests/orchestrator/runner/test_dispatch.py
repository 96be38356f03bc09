"""Nothing is lost with a worker, nothing counts twice, nothing is tried for ever."""

from __future__ import annotations

import pytest

from foretwin.contracts.runner import Task, TaskCount
from foretwin.contracts.simulation import PrepareRequest
from foretwin.orchestrator.runner.dispatch import ATTEMPTS, Dispatch
from foretwin.orchestrator.runner.sickness import FIRST_PAUSE_S


def task(key: str, world_id: str = "w") -> Task:
    return Task(key, "job", world_id, PrepareRequest(world_id=world_id))


def begun(*keys: str, workers: int = 2, in_flight: int = 1) -> Dispatch:
    """Tasks `world:number` or mere keys, submitted to workers that are up."""
    dispatch = Dispatch(in_flight=in_flight)
    dispatch.expect(f"w{number}" for number in range(workers))
    for number in range(workers):
        dispatch.worker_up(f"w{number}")
    for key in keys:
        dispatch.submit(task(key, key.split(":", 1)[0] if ":" in key else "w"))
    return dispatch


def given_out(dispatch: Dispatch, *, now_s: float = 0.0) -> list[tuple[str, str]]:
    return [(one.worker_id, one.task.key) for one in dispatch.assignments(now_s=now_s)]


def test_idle_workers_are_given_the_oldest_tasks() -> None:
    dispatch = begun("a", "b", "c")
    assert given_out(dispatch) == [("w0", "a"), ("w1", "b")]
    assert dispatch.answered("w1", "b")
    assert given_out(dispatch) == [("w1", "c")]


def test_rounds_of_one_task_are_played_in_turn() -> None:
    dispatch = begun()
    given = []
    for key in ("a", "b", "c"):
        dispatch.submit(task(key))
        given += given_out(dispatch)
        dispatch.answered(given[-1][0], key)
    assert given == [("w0", "a"), ("w1", "b"), ("w0", "c")]


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


def test_a_task_that_is_refused_goes_to_the_other_worker_though_the_first_is_idle() -> None:
    dispatch = begun("a")
    assert given_out(dispatch) == [("w0", "a")]
    assert dispatch.refused("w0", "a", "no disk", now_s=0.0) == []
    assert given_out(dispatch) == [("w1", "a")]
    assert dispatch.answered("w1", "a")
    assert dispatch.count == TaskCount(given=1, results=1)


def test_a_task_that_every_expected_worker_refused_is_given_up_and_blames_none() -> None:
    dispatch = begun("a", "b")
    given_out(dispatch)
    assert dispatch.answered("w1", "b")
    assert dispatch.refused("w0", "a", "no path", now_s=0.0) == []
    assert dispatch.sickness.sick == {"w0": "no path"}
    given_out(dispatch)
    ((lost, reason),) = dispatch.refused("w1", "a", "no path at all", now_s=0.0)
    assert (lost.key, reason, dispatch.open) == ("a", "no path at all", 0)
    assert dispatch.sickness.sick == {}
    assert dispatch.count == TaskCount(given=2, results=1, refused=1)


def test_who_refuses_what_is_wanted_no_more_is_late_and_not_sick() -> None:
    dispatch = begun("a")
    given_out(dispatch)
    dispatch.cancel("a")
    assert dispatch.refused("w0", "a", "Timeout", now_s=0.0) == []
    assert (dispatch.late, dispatch.sickness.sick, dispatch.sickness.refusals) == (1, {}, {})


def test_a_worker_that_is_down_may_yet_take_what_the_others_refused() -> None:
    dispatch = begun("a")
    dispatch.worker_down("w1")
    given_out(dispatch)
    assert dispatch.refused("w0", "a", "no disk", now_s=0.0) == []
    assert given_out(dispatch, now_s=1e6) == []
    dispatch.worker_up("w1")
    assert given_out(dispatch) == [("w1", "a")]


def test_what_nobody_that_is_up_will_do_can_be_given_up_at_a_deadline() -> None:
    dispatch = begun("a", "b")
    dispatch.worker_down("w1")
    given_out(dispatch)
    dispatch.refused("w0", "a", "no disk", now_s=0.0)
    assert dispatch.without_takers("b") == []
    ((lost, reason),) = dispatch.without_takers("a")
    assert (lost.key, reason) == ("a", "no disk")
    assert dispatch.count == TaskCount(given=2, refused=1)


def test_a_worker_that_never_comes_back_is_waited_for_no_more() -> None:
    dispatch = begun("a")
    dispatch.worker_down("w1")
    given_out(dispatch)
    dispatch.refused("w0", "a", "no disk", now_s=0.0)
    ((lost, _),) = dispatch.expect(["w0"])
    assert (lost.key, dispatch.count.refused) == ("a", 1)


def test_a_sick_worker_is_given_nothing_for_a_while_and_then_one_task() -> None:
    dispatch = begun("a", in_flight=2)
    given_out(dispatch)
    dispatch.refused("w0", "a", "no disk", now_s=10.0)
    for key in "bcdefg":
        dispatch.submit(task(key))
    assert {name for name, _ in given_out(dispatch, now_s=10.0 + 0.9 * FIRST_PAUSE_S)} == {"w1"}
    # Tried again, with one alone.
    ((tried, key),) = given_out(dispatch, now_s=10.0 + FIRST_PAUSE_S)
    assert tried == "w0"
    assert dispatch.answered("w0", key)
    assert [name for name, _ in given_out(dispatch, now_s=11.0)] == ["w0", "w0"]


def test_who_was_not_started_by_this_run_is_given_nothing() -> None:
    dispatch = begun("a", workers=1)
    dispatch.worker_down("w0")
    assert dispatch.worker_up("w9") == []
    assert dispatch.workers == ()
    assert given_out(dispatch) == []


def test_every_task_left_at_the_end_is_lost() -> None:
    dispatch = begun("a", "b", "c")
    given_out(dispatch)
    dispatch.answered("w0", "a")
    dispatch.close()
    assert dispatch.count == TaskCount(given=3, results=1, lost=2)
    assert not dispatch.answered("w1", "b")
    assert (dispatch.count.results, dispatch.late) == (1, 1)


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
