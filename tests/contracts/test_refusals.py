"""Refusals are counted by sender and reason, and each is told once."""

from __future__ import annotations

from foretwin.contracts.guard import Refused
from foretwin.contracts.refusal_counts import MOST_KINDS
from foretwin.contracts.refusals import Refusals

KEY = "foretwin/v1/run/r/mirror"


def test_the_first_of_a_kind_is_told_and_all_are_counted() -> None:
    refusals = Refusals()

    assert refusals.take(Refused(KEY, "no message", "5 bytes")) == (
        "refused: run/r/mirror: 5 bytes; more of the kind are counted"
    )
    assert refusals.take(Refused(KEY, "no message", "6 bytes")) is None
    assert refusals.take(Refused(KEY, "too large")) is not None
    assert refusals.take(Refused("other", "no message")) is not None
    assert refusals.record() == {
        "count": 4,
        "by_sender": [
            {"sender": "other", "reason": "no message", "count": 1},
            {"sender": "run/r/mirror", "reason": "no message", "count": 2},
            {"sender": "run/r/mirror", "reason": "too large", "count": 1},
        ],
    }


def test_who_makes_up_new_keys_fills_no_memory() -> None:
    assert MOST_KINDS == 200
    refusals = Refusals()
    told = [refusals.take(Refused(f"key{n}", "no message")) for n in range(MOST_KINDS + 50)]

    assert len([text for text in told if text]) == MOST_KINDS + 1
    assert len(refusals.record()["by_sender"]) == MOST_KINDS + 1
    assert refusals.record()["count"] == len(refusals) == MOST_KINDS + 50


def test_several_left_out_at_once_count_each() -> None:
    refusals = Refusals()

    assert refusals.note(KEY, "road users that cannot be", count=3) is not None
    assert refusals.note(KEY, "road users that cannot be", count=2) is None
    assert len(refusals) == 5
