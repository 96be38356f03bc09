"""Tokens of lives come in any order; told is how the life that began last fares."""

from __future__ import annotations

import pickle

from hypothesis import given
from hypothesis import strategies as st

from foretwin.contracts.keys import alive_key
from foretwin.contracts.lives import Lives, Word, key_of_life, life_of_key, new_life

W0, W1 = (alive_key(run="r1", process=name) for name in ("w0", "w1"))
A0, B0, A1 = key_of_life(W0, "a"), key_of_life(W0, "b"), key_of_life(W1, "a")


def test_a_process_comes_and_goes_under_its_own_key() -> None:
    lives = Lives()

    assert lives.take(A0, up=True) == Word(W0, True)
    assert lives.take(A0, up=False) == Word(W0, False)
    assert lives.take(A0, up=False) is None


def test_of_processes_that_are_gone_nothing_is_kept() -> None:
    lives = Lives()
    for number in range(10):
        for up in (True, False):
            lives.take(alive_key(run="r1", process=f"w{number}"), up=up)

    assert pickle.dumps(lives) == pickle.dumps(Lives())


def test_the_late_end_of_an_earlier_life_is_not_that_of_its_successor() -> None:
    lives = Lives()
    lives.take(A0, up=True)

    assert lives.take(B0, up=True) == Word(W0, True)
    assert lives.take(A0, up=False) is None
    assert lives.take(B0, up=False) == Word(W0, False)


def test_who_comes_late_hears_of_the_lives_in_any_order() -> None:
    lives = Lives()

    assert lives.take(B0, up=True) == Word(W0, True)
    assert lives.take(A0, up=True) is None
    assert lives.take(A0, up=False) is None
    assert lives.take(B0, up=False) == Word(W0, False)


def test_one_that_moved_to_a_machine_started_later_counts_once_its_old_life_has_ended() -> None:
    lives = Lives()
    lives.take(B0, up=True)

    assert lives.take(A0, up=True) is None
    assert lives.take(B0, up=False) == Word(W0, True)
    assert lives.take(A0, up=False) == Word(W0, False)


def test_each_process_has_lives_of_its_own() -> None:
    lives = Lives()
    lives.take(B0, up=True)

    assert lives.take(A1, up=True) == Word(W1, True)
    assert lives.take(A1, up=False) == Word(W1, False)


def test_a_token_without_a_life_is_of_the_earliest() -> None:
    lives = Lives()

    assert lives.take(W0, up=True) == Word(W0, True)
    assert lives.take(A0, up=True) == Word(W0, True)
    assert lives.take(W0, up=False) is None


def test_one_that_is_there_still_when_its_router_is_there_again_is_told_again() -> None:
    lives = Lives()

    assert [lives.take(A0, up=True) for _ in range(2)] == [Word(W0, True)] * 2


@given(life=st.from_regex(r"[a-z0-9/-]{0,20}", fullmatch=True))
def test_process_and_life_come_back_out_of_a_token(life: str) -> None:
    assert life_of_key(key_of_life(W0, life)) == (W0, life)


@given(count=st.integers(2, 40))
def test_lives_sort_as_they_begin(count: int) -> None:
    words = [new_life() for _ in range(count)]

    assert words == sorted(words)
    assert len(set(words)) == count
