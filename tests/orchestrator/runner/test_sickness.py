"""Who refuses is left in peace for a while, longer each time, and is well when it answers."""

from __future__ import annotations

import itertools

import pytest

from foretwin.orchestrator.runner.sickness import (
    FIRST_PAUSE_S,
    LONGEST_PAUSE_S,
    PAUSE_GROWS_BY,
    Sickness,
)


def held(sickness: Sickness, *, now_s: float) -> int:
    """How many of two tasks `w0` may hold beside another worker."""
    return sickness.may_hold(["w0", "other"], 2, now_s=now_s)["w0"]


def pause_s(sickness: Sickness, *, from_s: float) -> float:
    """How long from then on `w0` may hold nothing, to 10 ms."""
    steps = 0
    while not held(sickness, now_s=from_s + 0.01 * steps):
        steps += 1
    return 0.01 * steps


def test_pauses_grow_up_to_the_longest() -> None:
    sickness, now_s, pauses = Sickness(), 0.0, []
    for number in range(14):
        sickness.refused("w0", f"{number}", "no disk", now_s=now_s)
        pauses.append(pause_s(sickness, from_s=now_s))
        now_s += pauses[-1] + 0.01
    assert pauses[0] == pytest.approx(FIRST_PAUSE_S, abs=0.02)
    for before, after in itertools.pairwise(pauses):
        assert after == pytest.approx(min(PAUSE_GROWS_BY * before, LONGEST_PAUSE_S), abs=0.05)
    assert pauses[-1] == pytest.approx(LONGEST_PAUSE_S, abs=0.02)


def test_what_was_given_before_the_first_refusal_makes_no_pause_longer() -> None:
    sickness = Sickness()
    sickness.refused("w0", "a", "no disk", now_s=0.0)
    sickness.refused("w0", "b", "no disk", now_s=0.5 * FIRST_PAUSE_S)
    assert pause_s(sickness, from_s=0.0) == pytest.approx(FIRST_PAUSE_S, abs=0.02)


def test_after_its_pause_it_may_hold_one_task_and_after_an_answer_all() -> None:
    sickness = Sickness()
    sickness.refused("w0", "a", "no disk", now_s=0.0)
    assert held(sickness, now_s=FIRST_PAUSE_S) == 1
    assert sickness.may_hold(["w0", "w1"], 2, now_s=0.0) == {"w0": 0, "w1": 2}
    sickness.well("w0")
    assert held(sickness, now_s=0.0) == 2
    # Having been well, it begins with the first pause again.
    sickness.refused("w0", "b", "no disk", now_s=100.0)
    assert pause_s(sickness, from_s=100.0) == pytest.approx(FIRST_PAUSE_S, abs=0.02)


def test_where_all_are_sick_nobody_is_spared() -> None:
    sickness = Sickness()
    for worker_id in ("w0", "w1"):
        sickness.refused(worker_id, "a", "no disk", now_s=0.0)
    assert sickness.may_hold(["w0", "w1"], 2, now_s=0.0) == {"w0": 1, "w1": 1}
    assert sickness.may_hold(["w0", "w1", "w2"], 2, now_s=0.0) == {"w0": 0, "w1": 0, "w2": 2}


def test_a_task_that_all_refuse_is_held_against_nobody_and_others_are() -> None:
    sickness = Sickness()
    for worker_id, key in (("w0", "bad"), ("w1", "bad"), ("w1", "good")):
        sickness.refused(worker_id, key, f"no {key}", now_s=0.0)
    sickness.forgive(["w0", "w1", "w2"], "bad")
    assert sickness.sick == {"w1": "no good"}


def test_the_record_says_how_often_why_and_whether_still() -> None:
    sickness = Sickness()
    sickness.refused("w0", "a", "no disk", now_s=0.0)
    sickness.refused("w0", "b", "no memory", now_s=0.0)
    sickness.refused("w1", "a", "no disk", now_s=0.0)
    sickness.well("w1")
    assert sickness.record() == {
        "w0": {"count": 2, "last": "no memory", "sick": True},
        "w1": {"count": 1, "last": "no disk", "sick": False},
    }
