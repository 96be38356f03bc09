"""The clock, shared cores and threads of the model, by cases that can be told by hand."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.scale.engine import Clock, Host, Thread


def ends(cores: int, works_s: list[float], **host: float) -> list[float]:
    """Return when works that begin together are done, in their order."""
    clock, done = Clock(), [0.0] * len(works_s)
    shared = Host(clock, cores, **host)

    def note(place: int) -> None:
        done[place] = clock.now_s

    for place, work_s in enumerate(works_s):
        shared.run(work_s, lambda place=place: note(place))  # type: ignore[misc]
    clock.run()
    return done


def test_who_has_a_core_is_done_after_its_work() -> None:
    assert ends(2, [1.0, 3.0]) == pytest.approx([1.0, 3.0])


def test_those_without_a_core_each_share_evenly() -> None:
    # Three on two cores have two thirds each until the first is done.
    assert ends(2, [1.0, 2.0, 2.0]) == pytest.approx([1.5, 2.5, 2.5])


def test_busy_neighbours_slow_a_core() -> None:
    assert ends(2, [1.0, 1.0], contention=0.2) == pytest.approx([1.2, 1.2])
    assert ends(2, [1.0], contention=0.2) == pytest.approx([1.0])
    assert ends(2, [1.0, 2.0], contention=0.2) == pytest.approx([1.2, 2.2])


def test_others_take_their_share() -> None:
    assert ends(2, [1.0, 1.0], others_cores=1.0) == pytest.approx([2.0, 2.0])
    # Of one and a half cores two have three quarters each, and then the last all that it can use.
    assert ends(2, [0.75, 1.75], others_cores=0.5) == pytest.approx([1.0, 2.0])
    assert ends(2, [1.0], others_cores=1.0) == pytest.approx([1.0])


def test_others_who_take_all_leave_a_little() -> None:
    assert ends(2, [1.0], others_cores=2.0) == pytest.approx([20.0])


def test_a_thread_does_one_thing_after_another() -> None:
    clock, told = Clock(), []
    thread = Thread(Host(clock, 2))
    for name in "ab":
        thread.do(1.0, lambda name=name: told.append((name, clock.now_s)))  # type: ignore[misc]
    clock.run()
    assert told == [("a", 1.0), ("b", 2.0)]
    assert thread.work_s == 2.0


@given(st.lists(st.floats(0.01, 10.0), min_size=1, max_size=12), st.integers(1, 4))
def test_no_work_is_lost(works_s: list[float], cores: int) -> None:
    clock = Clock()
    host = Host(clock, cores)
    for work_s in works_s:
        host.run(work_s, lambda: None)
    clock.run()
    assert host.busy_core_s == pytest.approx(sum(works_s))
    assert clock.now_s >= max(*works_s, sum(works_s) / cores) * (1.0 - 1e-9)
    assert clock.now_s <= sum(works_s) * (1.0 + 1e-9)
