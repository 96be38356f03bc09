"""How many futures a round runs, and how often: a function of how long rounds before it took."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from foretwin.orchestrator.rounds.pace import (
    MEASURED_ROUNDS,
    Pace,
    RoundPace,
    RoundTime,
    future_s,
    next_pace,
    paces_between,
)

PERIOD_S = 0.5
PACES = paces_between(64, 16)
ALL, THREE_QUARTERS, HALF, QUARTER, SECOND, FOURTH = PACES

Load = Callable[[int, int], float]
"""Seconds of round k with n futures."""


def drive(
    load: Load, rounds: int, *, least: int = 16, cold: frozenset[int] = frozenset()
) -> list[Pace]:
    """Paces of the rounds of a drive; those of some numbers are cold."""
    pace = RoundPace(most=64, least=least, period_s=PERIOD_S)
    paces = []
    for number in range(rounds):
        paces.append(pace.now)
        by = [("w0", f"world {number}")] if number in cold else []
        pace.take(pace.now, load(number, pace.now.futures), by)
    return paces


@st.composite
def steady_loads(draw: st.DrawFn, *, give_or_take: float = 0.1) -> Load:
    """A cost of so much for each round and each future, give or take a share of it."""
    fixed_s = draw(st.floats(0.0, 2.0))
    each_s = draw(st.floats(0.0, 0.1))
    jitter = draw(st.lists(st.floats(-give_or_take, give_or_take), min_size=1, max_size=50))
    return lambda number, n: (fixed_s + each_s * n) * (1.0 + jitter[number % len(jitter)])


def test_paces_fall_from_all_futures_to_fewer_and_then_to_fewer_rounds() -> None:
    assert paces_between(64, 16) == (
        Pace(64), Pace(48), Pace(32), Pace(16), Pace(16, 2), Pace(16, 4),
    )  # fmt: skip
    assert paces_between(64, 40) == (Pace(64), Pace(48), Pace(40), Pace(40, 2), Pace(40, 4))
    assert paces_between(3, 1) == (Pace(3), Pace(2), Pace(1), Pace(1, 2), Pace(1, 4))
    assert paces_between(64, 8) == (
        Pace(64), Pace(48), Pace(32), Pace(16), Pace(8), Pace(8, 2), Pace(8, 4),
    )  # fmt: skip
    assert paces_between(64, 64) == (Pace(64),)


def test_a_machine_that_keeps_up_runs_all() -> None:
    assert drive(lambda _, n: 0.004 * n, 100) == [ALL] * 100


def test_a_machine_half_as_fast_as_need_be_runs_half() -> None:
    assert drive(lambda _, n: 0.0125 * n, 100) == [ALL] * 2 + [HALF] * 98


def test_where_a_round_costs_much_before_its_first_future_it_takes_two_steps() -> None:
    assert drive(lambda _, n: 0.4 + 0.004 * n, 100) == [ALL] * 2 + [HALF] * 2 + [QUARTER] * 96


def test_where_the_least_futures_are_too_many_rounds_become_rare() -> None:
    paces = drive(lambda _, n: 0.5 + 0.01 * n, 100)
    assert paces == [ALL] * 2 + [QUARTER] * 2 + [SECOND] * 96


def test_rounds_in_which_somebody_does_what_is_done_once_say_nothing_of_the_machine() -> None:
    cold = frozenset({0, 1, 40, 41})

    def load(number: int, n: int) -> float:
        return 9.0 if number in cold else 0.004 * n

    assert drive(load, 100, cold=cold) == [ALL] * 100
    assert drive(load, 3) == [ALL] * 2 + [FOURTH]
    slow = drive(lambda _, n: 0.0125 * n, 100, cold=cold)
    assert slow == [ALL] * 4 + [HALF] * 96


def test_a_worker_meets_each_world_once() -> None:
    pace = RoundPace(most=64, least=16, period_s=PERIOD_S)
    w0, w1 = ("w0", "here"), ("w1", "here")

    assert not pace.take(ALL, math.inf, [w0])
    assert not pace.take(ALL, math.inf, [w0, w1])
    assert not pace.take(ALL, 0.6, [w0, w1])
    assert pace.take(ALL, 0.6, [w1])
    assert pace.now == HALF


def test_what_a_future_costs_is_measured_where_the_pace_has_changed() -> None:
    def took(pace: Pace, *seconds: float) -> list[RoundTime]:
        return [RoundTime(pace, second) for second in seconds]

    assert future_s(took(ALL, 0.3, 0.4)) == math.inf
    assert future_s(took(ALL, 0.5, 0.6) + took(HALF, 0.45, 0.44)) == pytest.approx(0.16 / 32)
    assert future_s(took(HALF, 0.3) + took(ALL, 0.4, 0.46)) == pytest.approx(0.16 / 32)
    assert MEASURED_ROUNDS == 4
    old = took(ALL, 9.0) + took(ALL, *[0.6] * MEASURED_ROUNDS)
    later = took(HALF, *[0.5] * MEASURED_ROUNDS) + took(HALF, 0.1)
    assert future_s(old + later) == pytest.approx(0.1 / 32)
    # Rarer rounds of as many futures are rounds of those.
    rare = took(QUARTER, 0.6, 0.6) + took(SECOND, 0.5)
    assert future_s(took(HALF, 0.7) + rare) == pytest.approx(0.2 / 16)
    assert future_s(took(ALL, 0.3) + took(HALF, 0.5)) == 0.0


def test_where_futures_cost_little_it_rises_as_far_as_that_allows() -> None:
    """64 take 0.49 s and 16 take 0.266 s; in proportion, 64 would seem to take 1.06 s."""

    def load(number: int, n: int) -> float:
        return 0.19 + 0.0032 * n if number >= 12 else 0.6 + 0.0047 * n

    assert QUARTER in drive(load, 12)
    assert drive(load, 300)[-1] in (ALL, THREE_QUARTERS)


def test_one_late_round_alone_changes_nothing() -> None:
    assert drive(lambda number, _: 2.0 if number % 5 == 3 else 0.1, 100) == [ALL] * 100


def test_with_room_to_spare_all_are_run_again_and_every_fall_makes_it_wait_longer() -> None:
    paces = drive(lambda number, n: 1.5 if number in range(20, 60) else 0.002 * n, 300)
    changes = [n for n in range(1, 300) if paces[n] != paces[n - 1]]

    assert [paces[n] for n in changes] == [
        QUARTER,
        FOURTH,
        SECOND,
        QUARTER,
        HALF,
        THREE_QUARTERS,
        ALL,
    ]
    assert changes[2] - 60 >= 3 * 10 // 4 - 2
    assert changes[5] - changes[4] == 3 * 10


@pytest.mark.parametrize(("falls", "calm_rounds"), [(1, 20), (4, 50), (5, 60), (9, 60)])
def test_each_fall_makes_it_wait_ten_periods_longer_up_to_sixty(
    falls: int, calm_rounds: int
) -> None:
    """Until it rises again, though there is room to spare."""
    before = [RoundTime(pace, 0.3) for pace in (ALL, HALF)] * falls
    waits, rises = (
        [*before[:-1], *[RoundTime(HALF, 0.1)] * count] for count in (calm_rounds - 1, calm_rounds)
    )
    assert next_pace(waits, PACES, period_s=PERIOD_S) == HALF
    assert next_pace(rises, PACES, period_s=PERIOD_S) == THREE_QUARTERS


def test_of_rare_rounds_four_are_enough() -> None:
    def after(count: int) -> Pace:
        return next_pace([RoundTime(FOURTH, 0.1)] * count, PACES, period_s=PERIOD_S)

    assert (after(3), after(4)) == (FOURTH, SECOND)


@pytest.mark.parametrize(("slow", "rises"), [(2, True), (3, False)])
def test_a_tenth_of_calm_rounds_may_have_been_slow(slow: int, rises: bool) -> None:
    """Of twenty, after one fall."""
    calm = [RoundTime(HALF, 0.1)] * (20 - slow) + [RoundTime(HALF, 0.4)] * slow
    found = next_pace([RoundTime(ALL, 0.6), *calm], PACES, period_s=PERIOD_S)
    assert found == (THREE_QUARTERS if rises else HALF)


def test_what_a_pace_remembers_of_a_long_drive_has_an_end() -> None:
    pace = RoundPace(most=64, least=16, period_s=PERIOD_S)
    for number in range(600):
        pace.take(ALL, 0.1, [("w0", f"world {number // 2}")])
    assert (len(pace._history), len(pace._met)) == (240, 64)


def test_what_is_run_of_what_was_asked_for_is_told() -> None:
    pace = RoundPace(most=64, least=16, period_s=PERIOD_S)
    assert (pace.slowed, pace.short_of) == (False, "")
    pace.now = HALF
    assert (pace.slowed, pace.short_of) == (True, "32 of 64 futures")
    pace.now = FOURTH
    assert pace.short_of == "16 of 64 futures in 1 of 4 rounds"


def test_a_round_that_was_given_up_counts_as_endless() -> None:
    pace = RoundPace(most=64, least=16, period_s=PERIOD_S)

    assert not pace.take(ALL, math.inf)
    assert pace.take(ALL, math.inf)
    assert pace.now == FOURTH
    assert pace.slowed


@given(most=st.integers(1, 500), share=st.floats(0.0, 1.0))
def test_paces_lie_between_the_least_and_all(most: int, share: float) -> None:
    least = max(1, round(share * most))
    paces = paces_between(most, least)

    assert paces[0] == Pace(most)
    assert min(pace.futures for pace in paces) == least
    assert all(a.futures_per_period > b.futures_per_period for a, b in pairwise(paces))


@given(
    st.lists(
        st.builds(RoundTime, st.sampled_from(PACES), st.floats(0.0, 20.0) | st.just(math.inf)),
        max_size=100,
    )
)
def test_whatever_happened_the_next_round_has_one_of_the_paces(history: list[RoundTime]) -> None:
    assert next_pace(history, PACES, period_s=PERIOD_S) in PACES


@settings(max_examples=50)
@given(steady_loads(give_or_take=0.0))
def test_under_a_constant_load_paces_fall_to_what_fits_and_stay(load: Load) -> None:
    paces = drive(load, 80)
    ranks = [PACES.index(pace) for pace in paces]

    assert ranks == sorted(ranks)
    assert len(set(ranks[12:])) == 1
    assert paces[-1] == PACES[-1] or load(0, paces[-1].futures) <= PERIOD_S * paces[-1].one_of


@settings(max_examples=20)
@given(steady_loads())
def test_under_a_load_that_varies_by_a_tenth_paces_come_to_rest(load: Load) -> None:
    assert len(set(drive(load, 320)[200:])) == 1


@settings(max_examples=20)
@given(steady_loads(), steady_loads())
def test_after_a_change_of_load_paces_come_to_rest_again(before: Load, after: Load) -> None:
    paces = drive(lambda number, n: (before if number < 100 else after)(number, n), 500)

    assert len(set(paces[400:])) == 1


@pytest.mark.parametrize("seconds", [0.0, 0.6, 100.0])
def test_where_all_are_wanted_all_are_run(seconds: float) -> None:
    assert drive(lambda *_: seconds, 50, least=64) == [ALL] * 50
