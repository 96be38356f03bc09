"""Rounds of fewer futures take turns with all that were planned."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.contracts.futures import Future
from foretwin.orchestrator.rounds.fewer_futures import some_of
from foretwin.sim_worker.futures.future_mix import plan_futures
from foretwin.sim_worker.scenarios.reading import catalogue

ALL = plan_futures(
    count=64, seed=0, planners=["pure_pursuit_idm"], scenarios=tuple(catalogue().values())[:12]
)


def happening(futures: tuple[Future, ...]) -> int:
    return sum(bool(future.scenario_id) for future in futures)


@given(count=st.integers(1, 64), turn=st.integers(0, 10_000))
def test_the_nominal_future_comes_first_and_none_twice(count: int, turn: int) -> None:
    some = some_of(ALL, count, turn=turn)

    assert some[0] is ALL[0]
    assert len(some) == count
    indices = [future.index for future in some]
    assert indices == sorted(set(indices))


@given(count=st.integers(2, 64), turn=st.integers(0, 10_000))
def test_scenarios_and_faults_keep_their_shares(count: int, turn: int) -> None:
    share = happening(ALL) / 63 * (count - 1)

    assert happening(some_of(ALL, count, turn=turn)) == pytest.approx(share, abs=0.51)


@pytest.mark.parametrize("count", [8, 16, 32, 48])
def test_speeds_stay_spread_over_their_whole_range(count: int) -> None:
    for turn in range(8):
        for kind in (True, False):
            all_speeds = sorted(
                v.numbers["target_speed_factor"] for v in ALL[1:] if bool(v.scenario_id) is kind
            )
            speeds = sorted(
                v.numbers["target_speed_factor"]
                for v in some_of(ALL, count, turn=turn)[1:]
                if bool(v.scenario_id) is kind
            )
            stratum = math.ceil(len(all_speeds) / len(speeds))
            for place, speed in enumerate(speeds):
                expected = all_speeds[len(all_speeds) * place // len(speeds) :][:stratum]
                assert expected[0] <= speed <= expected[-1]


@pytest.mark.parametrize("count", [16, 32, 48])
def test_all_have_come_after_a_few_turns(count: int) -> None:
    turns = math.ceil(63 / (count - 1)) + 1
    come = {v.index for turn in range(turns) for v in some_of(ALL, count, turn=turn)}

    assert come == set(range(64))


def test_as_many_as_there_are_is_all_of_them() -> None:
    assert some_of(ALL, 64, turn=3) == ALL
    assert some_of(ALL, 65, turn=3) == ALL
    with pytest.raises(ValueError, match="0 futures: at least 1"):
        some_of(ALL, 0, turn=0)


@given(
    count=st.integers(2, 63),
    turn=st.integers(0, 100),
    worst=st.lists(st.sampled_from(ALL[1:]), unique_by=lambda future: future.index, max_size=40),
)
def test_those_found_worst_come_first_and_leave_room_for_others(
    count: int, turn: int, worst: list[Future]
) -> None:
    some = some_of(ALL, count, turn=turn, first=worst)
    indices = [future.index for future in some]

    assert some[0] is ALL[0]
    assert len(some) == count
    assert indices == sorted(set(indices))
    assert {future.index for future in worst[: (count - 1) // 2]} <= set(indices)
    assert some == some_of(ALL, count, turn=turn, first=worst)


def test_all_still_come_within_some_rounds_where_the_same_are_always_worst() -> None:
    worst = ALL[1:60]
    seen = {f.index for turn in range(16) for f in some_of(ALL, 16, turn=turn, first=worst)}
    assert seen == {future.index for future in ALL}


def test_who_names_no_speed_is_among_those_of_the_usual_one() -> None:
    """Cut into three strata by speed: the slow, the usual and the fast."""
    speeds = [None, 0.7, 1.3, None, 0.8, 1.2, None]
    some = [
        Future(index=k, name=str(k), numbers={} if s is None else {"target_speed_factor": s})
        for k, s in enumerate(speeds)
    ]
    turns = [[f.index for f in some_of(some, 4, turn=turn)] for turn in range(2)]
    by_stratum = [{1, 4}, {3, 6}, {2, 5}]
    for turn in turns:
        assert [len(set(turn) & stratum) for stratum in by_stratum] == [1, 1, 1]


def test_a_future_of_another_junction_is_not_taken_for_one_of_this() -> None:
    other = plan_futures(count=64, seed=1, planners=["pure_pursuit_idm"])
    assert some_of(ALL, 16, turn=3, first=other[1:]) == some_of(ALL, 16, turn=3)
