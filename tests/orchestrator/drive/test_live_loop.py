"""The live loop: rounds on the grid of the wall clock, late ones missed, nothing waits."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from foretwin.orchestrator.drive import live_loop
from foretwin.orchestrator.drive.live_loop import GATHER_S, LiveLoop
from tests.orchestrator.drive.loop_stage import Clock, Conductor, every


@pytest.fixture(autouse=True)
def _states_are_samples(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(live_loop, "is_telemetry", lambda item: item == "state")


@pytest.fixture
def driven(monkeypatch: pytest.MonkeyPatch) -> Any:
    def drive(**settings: Any) -> Conductor:
        clock = Clock()
        monkeypatch.setattr(live_loop, "time", clock)
        conductor = Conductor(clock, **settings)
        loop = LiveLoop(conductor, housekeeping=lambda _: None, stop=lambda: False)  # type: ignore[arg-type]
        assert loop.run()
        assert conductor.tally.ledger().balanced()
        return conductor

    return drive


def test_rounds_start_on_the_grid(driven: Any) -> None:
    conductor = driven(states_s=every(0.02, 10.0), end_s=10.0)
    assert len(conductor.started_s) == 20
    for number, started_s in enumerate(conductor.started_s):
        assert started_s == pytest.approx(0.5 * number, abs=0.021)
    assert conductor.tally.missed == 0


def test_no_round_starts_while_workers_take_new_parameters(driven: Any) -> None:
    conductor = driven(states_s=every(0.02, 5.0), end_s=5.0, settled_s=1.3)
    assert conductor.started_s[0] == pytest.approx(1.3, abs=0.03)
    assert conductor.started_s[1] == pytest.approx(1.5, abs=0.03)


def test_a_round_waits_for_a_fresh_state_but_not_for_long(driven: Any) -> None:
    often = driven(states_s=every(0.2, 6.0, start_s=0.13), end_s=6.0, received=True)
    for started_s in often.started_s[1:]:
        since_state_s = (started_s - 0.13) % 0.2
        assert min(since_state_s, 0.2 - since_state_s) < 1e-3
    seldom = driven(states_s=every(0.8, 6.0, start_s=0.1), end_s=6.0)
    for number, started_s in enumerate(seldom.started_s[1:], start=1):
        assert 0.5 * number - 1e-3 <= started_s <= 0.5 * number + 0.251


def test_a_round_waits_half_a_period_for_the_one_before_and_is_missed_then(driven: Any) -> None:
    conductor = driven(states_s=every(0.02, 12.0), end_s=12.0, round_s=0.7)
    assert conductor.started_s[:5] == pytest.approx([0.0, 0.7, 1.5, 2.2, 3.0], abs=0.03)
    assert (len(conductor.started_s), conductor.tally.missed) == (16, 8)
    assert conductor.dropped_s == []


def test_rounds_that_begin_with_a_slow_receiver_have_their_whole_period(driven: Any) -> None:
    # Of fixes five times a second, every other round begins .1 s after it was due.
    conductor = driven(states_s=every(0.2, 9.9), end_s=9.9, round_s=0.45, received=True)
    assert conductor.tally.missed == 0
    starts_s = np.array(conductor.started_s)
    assert np.diff(starts_s).min() >= 0.45
    assert (starts_s - conductor.seeds_s).max() < 0.1, "the newest state is the seed"


def test_a_round_that_waits_as_the_drive_ends_was_due(driven: Any) -> None:
    conductor = driven(states_s=every(0.02, 10.1), end_s=10.1, round_s=0.7)
    assert conductor.started_s[-1] == pytest.approx(9.7, abs=0.03)
    assert conductor.tally.due == 21


def test_a_round_that_nobody_will_complete_holds_none_up(driven: Any) -> None:
    conductor = driven(states_s=every(0.02, 5.0), end_s=5.0, round_s=0.7, takers=False)
    assert conductor.started_s == pytest.approx([0.5 * number for number in range(10)], abs=0.03)
    assert conductor.dropped_s[:9] == pytest.approx(conductor.started_s[1:], abs=1e-3)


def test_while_a_round_waits_samples_are_gathered_as_ever(driven: Any) -> None:
    def turns(round_s: float) -> int:
        conductor = driven(states_s=every(0.003, 10.0), end_s=10.0, round_s=round_s)
        return len(conductor.changes_made_s)

    assert turns(0.7) < 1.5 * turns(0.1)


@pytest.mark.parametrize("settled_s", [5.0, 1e6])
def test_what_may_not_start_is_waited_for_in_peace(driven: Any, settled_s: float) -> None:
    conductor = driven(states_s=[0.01], end_s=10.0, settled_s=settled_s)
    assert len(conductor.changes_made_s) < 500


def test_a_round_that_never_ends_is_given_up(driven: Any) -> None:
    conductor = driven(states_s=every(0.02, 25.0), end_s=25.0, round_s=1e6)
    assert conductor.dropped_s == pytest.approx([10.0, 20.5], abs=0.6)
    assert len(conductor.started_s) == 3
    assert conductor.tally.missed > 40


def test_a_machine_that_slept_does_not_catch_up_and_owns_up(driven: Any) -> None:
    def sleep_once(at_s: float) -> None:
        if 3.0 <= at_s < 3.02:
            live_loop.time.now_s += 4.3  # type: ignore[attr-defined]

    conductor = driven(states_s=every(0.02, 10.0), end_s=10.0, handling=sleep_once)
    around = [started_s for started_s in conductor.started_s if 2.9 < started_s < 8.1]
    assert around == pytest.approx([7.3, 7.5, 8.0], abs=0.03)
    assert conductor.tally.missed == 8  # those due at 3.5, 4.0 and so on until 7.0


def test_a_slow_machine_that_slept_leaves_out_both_what_it_spares_and_what_it_missed(
    driven: Any,
) -> None:
    def sleep_once(at_s: float) -> None:
        if 3.0 <= at_s < 3.02:
            live_loop.time.now_s += 4.3  # type: ignore[attr-defined]

    tally = driven(states_s=every(0.02, 10.0), end_s=10.0, one_of=2, handling=sleep_once).tally
    # Of 20 every other one; those due at 3, 4, 5 and 6 found it asleep.
    assert (tally.due, tally.run, tally.spared, tally.missed) == (20, 6, 10, 4)


def test_no_round_starts_from_a_state_that_is_old(driven: Any) -> None:
    conductor = driven(states_s=[*every(0.02, 2.0), *every(0.02, 8.0, start_s=6.0)], end_s=8.0)

    assert not [s for s in conductor.started_s if 3.01 < s < 6.0]
    assert [s for s in conductor.started_s if s >= 6.0]
    # From 3.0 to 5.5: the vehicle said nothing.
    assert (conductor.tally.unseeded, conductor.tally.missed) == (6, 0)


def test_rounds_due_while_messages_wait_and_the_state_is_old_are_missed(driven: Any) -> None:
    def slowly(at_s: float) -> None:
        if at_s >= 3.0:
            live_loop.time.now_s += 0.5  # type: ignore[attr-defined]

    tally = driven(states_s=every(0.02, 4.0), end_s=4.0, handling=slowly, received=True).tally
    assert tally.due > 40
    assert tally.missed > 30
    assert tally.unseeded == 0


def test_no_round_is_due_where_the_mission_wants_none(driven: Any) -> None:
    conductor = driven(states_s=every(0.02, 4.0), end_s=4.0, wants_rounds=False)
    assert (conductor.started_s, conductor.tally.due) == ([], 0)


def test_what_is_due_at_the_end_and_cannot_start_is_missed(driven: Any) -> None:
    conductor = driven(states_s=every(0.02, 3.9), end_s=3.9, settled_s=1e6)
    assert conductor.started_s == []
    assert conductor.tally.due == conductor.tally.missed == 8


def test_no_round_starts_before_the_first_state(driven: Any) -> None:
    assert driven(states_s=[], end_s=3.0).started_s == []


def test_a_loop_that_is_stopped_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = Clock()
    monkeypatch.setattr(live_loop, "time", clock)
    conductor = Conductor(clock, states_s=every(0.02, 10.0), end_s=10.0)
    kept: list[float] = []
    loop = LiveLoop(conductor, kept.append, lambda: clock.now_s > 102.0)  # type: ignore[arg-type]

    assert not loop.run()
    assert clock.now_s < 102.2
    assert len(kept) == pytest.approx(20, abs=2)


def test_silence_is_looked_into_every_100_ms(driven: Any) -> None:
    conductor = driven(states_s=[0.0, 0.01, 0.02], end_s=5.0)
    gaps_s = np.diff([GATHER_S, *conductor.watched_s, 5.0])
    assert gaps_s.max() < 0.101
    assert len(conductor.bus.recovered) == 1, "the car's end is asked for, and once more"


def test_where_the_machine_is_too_slow_rounds_become_rare_and_are_not_missed(driven: Any) -> None:
    conductor = driven(states_s=every(0.02, 10.0), end_s=10.0, round_s=0.7, one_of=2)
    assert conductor.started_s == pytest.approx([*range(10)], abs=0.03)
    assert (conductor.tally.missed, conductor.tally.spared) == (0, 10)


def test_a_round_starts_from_the_newest_state_of_a_portion(driven: Any) -> None:
    conductor = driven(states_s=every(0.007, 10.0), end_s=10.0, received=True)
    for started_s, state_s in zip(conductor.started_s[1:], conductor.seeds_s[1:], strict=True):
        assert 0.0 <= started_s - state_s < 0.0071


def test_a_state_that_came_with_a_portion_before_a_round_was_due_is_not_fresh(driven: Any) -> None:
    conductor = driven(states_s=every(0.1, 10.0, start_s=0.04), end_s=10.0, received=True)
    assert conductor.started_s[1:] == pytest.approx([0.54 + k / 2 for k in range(19)], abs=1e-3)
    assert conductor.seeds_s[1:] == pytest.approx(conductor.started_s[1:], abs=1e-3)


def test_messages_are_gathered_and_no_round_waits_for_it(driven: Any) -> None:
    conductor = driven(states_s=every(0.003, 10.0), end_s=10.0)
    gathered_s = [length_s for length_s in conductor.mailbox.gathered_s if length_s]
    assert 90 < len(gathered_s) <= 150 and max(gathered_s) <= GATHER_S + 1e-9  # noqa: PT018
    assert conductor.started_s[:20] == pytest.approx([k / 2 for k in range(20)], abs=0.0031)


@pytest.mark.parametrize(("towards_vehicle", "oldest_s"), [(True, 0.0011), (False, 0.1011)])
def test_a_state_of_a_car_that_is_shown_things_waits_for_no_portion(
    driven: Any, towards_vehicle: bool, oldest_s: float
) -> None:
    came_s = [*every(0.02, 5.0), 5.0]
    ages_s: list[float] = []
    conductor = driven(
        states_s=came_s[:-1], end_s=5.0, towards_vehicle=towards_vehicle, wants_rounds=False,
        handling=lambda at_s: ages_s.append(at_s - came_s[len(ages_s)]),
    )  # fmt: skip
    assert max(ages_s) < oldest_s
    assert towards_vehicle or max(ages_s) > 0.079
    gathered_s = [length_s for length_s in conductor.mailbox.gathered_s if length_s]
    # What comes between two states comes in a portion all the same.
    assert sum(gathered_s) > 4.0
    assert len(gathered_s) <= (250 if towards_vehicle else 50) + 50


@pytest.fixture
def turns(monkeypatch: pytest.MonkeyPatch) -> Any:
    """What a loop does in turn, with its seconds: turns, items that it takes, rounds."""

    def drive(*, answer_at: int | None = None, handling_s: float = 0.0, **settings: Any) -> Any:
        clock, done = Clock(), list[tuple[str, float]]()
        monkeypatch.setattr(live_loop, "time", clock)
        conductor = Conductor(clock, **settings)
        if answer_at is not None:
            conductor.mailbox.answer_at(answer_at)
        handle, start = conductor.handle, conductor.start_round

        def handled(item: str) -> None:
            clock.now_s += handling_s
            done.append((item, clock.now_s))
            handle(item)

        def started() -> bool:
            done.append(("round", clock.now_s))
            return start()

        conductor.handle = handled  # type: ignore[method-assign]
        conductor.start_round = started  # type: ignore[method-assign]
        turn = lambda: done.append(("turn", clock.now_s))  # noqa: E731
        LiveLoop(conductor, lambda _: None, lambda: False, turn).run()  # type: ignore[arg-type]
        return done

    return drive


@pytest.mark.parametrize(("towards_vehicle", "pause_s"), [(True, 0.05), (False, 0.1)])
def test_something_is_done_each_turn_and_turns_are_frequent(
    turns: Any, towards_vehicle: bool, pause_s: float
) -> None:
    rest: Any = {"wants_rounds": False, "towards_vehicle": towards_vehicle}
    for done in (
        turns(states_s=[0.0, 0.3], end_s=1.0, **rest),
        turns(states_s=every(0.003, 0.4), end_s=0.4, handling_s=0.004, **rest),
    ):
        turns_s = [at_s for what, at_s in done if what == "turn"]
        assert np.diff([*turns_s, done[-1][1]]).max() < pause_s + 0.0041


def test_samples_of_a_portion_need_no_turn_and_what_else_comes_gets_one(turns: Any) -> None:
    done = [what for what, _ in turns(states_s=every(0.003, 2.7), end_s=2.8, answer_at=700)]
    assert done.count("state") == 900
    assert done.count("turn") < 150
    assert done[done.index("answer") + 1] == "turn"


def test_a_round_waits_for_the_samples_that_came_with_an_answer(turns: Any) -> None:
    states: Any = {"states_s": [0.0, 0.51, 0.512, 0.514], "end_s": 0.9, "received": True}
    done = [what for what, _ in turns(answer_at=2, handling_s=0.004, **states)]
    assert done.count("round") == 2
    after = done[done.index("answer") :]
    assert after.index("round") > max(place for place, what in enumerate(after) if what == "state")


def test_changes_asked_for_are_looked_at_every_turn(driven: Any) -> None:
    conductor = driven(states_s=[0.0, 0.3], end_s=1.0)
    assert np.diff([*conductor.changes_made_s, 1.0]).max() < 0.101


def test_changes_are_made_between_rounds_that_follow_one_another(driven: Any) -> None:
    conductor = driven(states_s=every(0.02, 10.0), end_s=10.0, round_s=0.7)
    for started_s in conductor.started_s:
        assert min(abs(made_s - started_s) for made_s in conductor.changes_made_s) < 1e-9
