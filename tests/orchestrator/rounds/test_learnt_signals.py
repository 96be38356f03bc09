"""Cycles of lights are learnt from what a car hears; what does not repeat stays unknown."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.contracts.drive import SignalColour, SignalState
from foretwin.contracts.signals import LearntSignal
from foretwin.orchestrator.rounds.learnt_signals import SignalLearner
from foretwin.world_gen.rules.signal_state import heard_cycle
from tests.orchestrator.house import House
from tests.orchestrator.trip import START_NS

Colours = Callable[[float], SignalColour]


def fixed(cycle_s: float, green_s: float, offset_s: float = 0.0) -> Colours:
    """Return a light that is green for `green_s`, then 3 s amber, red, and 1 s red and amber."""

    def colour(time_s: float) -> SignalColour:
        into_s = (time_s - offset_s) % cycle_s
        if into_s < green_s:
            return "green"
        if into_s < green_s + 3.0:
            return "amber"
        return "red" if into_s < cycle_s - 1.0 else "red_amber"

    return colour


def ns(time_s: float) -> int:
    return START_NS + round(time_s * 1e9)


def hear(
    learner: SignalLearner, light: Colours, from_s: float, to_s: float, *, hz: float = 2.0,
    group: str = "g",
) -> None:  # fmt: skip
    """Let a learner hear what a light shows, so many times a second."""
    for time_s in np.arange(from_s, to_s, 1.0 / hz).tolist():
        learner.take(SignalState(stamp_ns=ns(time_s), group_id=group, colour=light(time_s)))


def learnt(learner: SignalLearner, at_s: float) -> LearntSignal | None:
    found = learner.learnt(ns(at_s))
    assert len(found) <= 1
    return found[0] if found else None


@given(
    cycle_s=st.floats(40.0, 120.0),
    share=st.floats(0.2, 0.7),
    offset_s=st.floats(0.0, 120.0),
    hz=st.sampled_from([1.0, 2.0, 10.0]),
    more=st.floats(0.0, 1.0),
)
def test_a_fixed_cycle_is_foretold(
    cycle_s: float, share: float, offset_s: float, hz: float, more: float
) -> None:
    light, learner = fixed(cycle_s, share * cycle_s, offset_s), SignalLearner()
    until_s = (3.1 + more) * cycle_s
    hear(learner, light, 0.0, until_s, hz=hz)
    found = learnt(learner, until_s)
    assert found is not None
    assert found.cycle_s == pytest.approx(cycle_s, abs=1.0 / hz)
    assert 2 <= found.cycles <= 4
    assert found.spread_s <= 2.0 / hz
    ahead = heard_cycle(found, ns(until_s))
    for time_s in np.arange(0.0, 2.0 * cycle_s, 0.7).tolist():
        near = {light(until_s + time_s + d * 2.0 / hz) for d in (-1.0, -0.5, 0.0, 0.5, 1.0)}
        assert ahead.colour_at(time_s) in near


def test_one_cycle_is_not_enough() -> None:
    light, learner = fixed(60.0, 20.0), SignalLearner()
    hear(learner, light, -5.0, 115.0)
    assert learnt(learner, 115.0) is None
    hear(learner, light, 115.0, 125.0)
    assert learnt(learner, 125.0) is not None


def test_a_cycle_is_as_long_as_all_that_were_heard_are_on_average() -> None:
    learner, begin_s = SignalLearner(), 0.0
    hear(learner, fixed(60.0, 20.0), -5.0, 0.0, hz=10.0)
    for cycle_s in (60.3, 60.0, 60.0):
        hear(learner, fixed(cycle_s, 20.0, begin_s), begin_s, begin_s + cycle_s, hz=10.0)
        begin_s += cycle_s
    hear(learner, fixed(60.0, 20.0, begin_s), begin_s, begin_s + 5.0, hz=10.0)
    found = learnt(learner, begin_s + 5.0)
    assert found is not None
    assert found.cycle_s == pytest.approx(60.1, abs=0.04)


def test_a_light_that_follows_the_traffic_stays_unknown() -> None:
    learner, begin_s = SignalLearner(), 0.0
    for green_s in (12.0, 31.0, 7.0, 24.0, 18.0):
        hear(learner, fixed(40.0 + green_s, green_s, begin_s), begin_s, begin_s + 40.0 + green_s)
        begin_s += 40.0 + green_s
    assert learnt(learner, begin_s) is None


@pytest.mark.parametrize("missed_s", [(75.0, 85.0), (77.5, 84.0)])
def test_a_cycle_in_which_a_change_was_missed_counts_for_nothing(
    missed_s: tuple[float, float],
) -> None:
    light, learner = fixed(60.0, 20.0), SignalLearner()
    hear(learner, light, -5.0, missed_s[0])
    hear(learner, light, missed_s[1], 125.0)
    assert learnt(learner, 125.0) is None
    hear(learner, light, 125.0, 245.0)
    found = learnt(learner, 245.0)
    assert found is not None
    assert (found.cycle_s, found.cycles) == (pytest.approx(60.0, abs=0.05), 3)


def test_cycles_alike_that_are_out_of_step_are_of_no_one_plan() -> None:
    learner = SignalLearner()
    hear(learner, fixed(60.0, 20.0), -5.0, 65.0)
    hear(learner, fixed(60.0, 20.0, 30.0), 85.0, 155.0)
    assert learnt(learner, 155.0) is None
    hear(learner, fixed(60.0, 20.0, 30.0), 155.0, 215.0)
    assert learnt(learner, 215.0) is None, "the first does not fit the others yet"


def test_a_dark_or_unknown_spell_breaks_a_cycle_too() -> None:
    light, learner = fixed(60.0, 20.0), SignalLearner()
    for word in ("dark", "unknown"):
        hear(learner, light, 0.0, 90.0, group=word)
        learner.take(SignalState(stamp_ns=ns(90.0), group_id=word, colour=word))
        hear(learner, light, 90.5, 130.0, group=word)
    assert learner.learnt(ns(130.0)) == ()
    hear(learner, light, -5.0, 130.0, group="whole")
    assert [one.group_id for one in learner.learnt(ns(130.0))] == ["whole"]
    learner.take(SignalState(stamp_ns=ns(131.0), group_id="whole", colour="dark"))
    assert learner.learnt(ns(131.0)) == ()


def test_another_plan_is_learnt_anew() -> None:
    learner = SignalLearner()
    hear(learner, fixed(60.0, 20.0), 0.0, 185.0)
    assert learnt(learner, 185.0) is not None
    other = fixed(80.0, 30.0, 185.0)
    hear(learner, other, 185.0, 225.0)
    assert learnt(learner, 225.0) is None, "it shows what the cycle does not say"
    hear(learner, other, 225.0, 430.0)
    found = learnt(learner, 430.0)
    assert found is not None
    assert found.cycle_s == pytest.approx(80.0, abs=0.5)


@pytest.mark.parametrize(("share", "holds"), [(0.95, True), (1.05, False)])
@pytest.mark.parametrize("early", [True, False])
def test_a_change_may_come_half_a_second_beyond_what_was_heard_to_stray(
    share: float, holds: bool, early: bool
) -> None:
    learner = SignalLearner()
    hear(learner, fixed(60.0, 20.0), -5.0, 185.0, hz=10.0)
    found = learnt(learner, 185.0)
    assert found is not None
    assert found.spread_s == pytest.approx(0.1, abs=0.06)
    green_ns = found.begins_ns + round(2.0 * found.cycle_s * 1e9)
    off_ns = round(share * (found.spread_s + 0.5) * 1e9)
    colour: SignalColour = "green" if early else "red_amber"
    stamp_ns = green_ns - off_ns if early else green_ns + off_ns
    learner.take(SignalState(stamp_ns=stamp_ns, group_id="g", colour=colour))
    assert (learner.learnt(stamp_ns) != ()) == holds


@pytest.mark.parametrize(
    ("cycle_s", "green_s", "alike"),
    [(60.45, 20.0, True), (60.6, 20.0, False), (60.0, 20.45, True), (60.0, 20.6, False)],
)
def test_two_cycles_are_alike_where_no_change_strays_by_more_than_half_a_second(
    cycle_s: float, green_s: float, alike: bool
) -> None:
    """Beyond the 0.02 s between two reports."""
    learner = SignalLearner()
    hear(learner, fixed(60.0, 20.0), -1.0, 60.0, hz=50.0)
    hear(learner, fixed(cycle_s, green_s, 60.0), 60.0, 60.0 + cycle_s + 1.0, hz=50.0)
    assert (learnt(learner, 61.0 + cycle_s) is not None) == alike


def test_what_two_cycles_have_in_common_is_the_mean_of_both() -> None:
    learner = SignalLearner()
    hear(learner, fixed(60.0, 20.0), -1.0, 60.0, hz=50.0)
    hear(learner, fixed(60.4, 20.4, 60.0), 60.0, 122.0, hz=50.0)
    found = learnt(learner, 122.0)
    assert found is not None
    assert (found.cycle_s, found.cycles) == (pytest.approx(60.2, abs=0.02), 2)
    assert found.colours == ("green", "amber", "red", "red_amber")
    assert found.from_s == pytest.approx((0.0, 20.2, 23.2, 59.2), abs=0.02)
    assert (found.begins_ns - START_NS) / 1e9 == pytest.approx(60.1, abs=0.02)
    assert found.spread_s == pytest.approx(0.2, abs=0.02)
    said = learner.record(ns(122.0), START_NS)["g"]
    assert said["lasts_s"] == {"green": 20.2, "amber": 3.0, "red": 36.0, "red_amber": 1.0}


def test_of_cycles_with_another_between_them_the_newest_that_are_alike_count() -> None:
    learner = SignalLearner()
    for number, green_s in enumerate((20.0, 30.0, 20.0, 20.0)):
        begin_s = 60.0 * number
        hear(learner, fixed(60.0, green_s, begin_s), begin_s - 5.0 * (not number), begin_s + 60.0)
        if number == 2:
            assert learnt(learner, begin_s + 60.0) is None
    hear(learner, fixed(60.0, 20.0, 240.0), 240.0, 245.0)
    found = learnt(learner, 245.0)
    assert found is not None
    assert found.cycles == 2


def test_of_a_long_drive_the_newest_six_cycles_count() -> None:
    learner, begin_s = SignalLearner(), 0.0
    hear(learner, fixed(60.0, 20.0), -5.0, 0.0)
    for cycle_s in (60.4, 60.4, 60.4, *[60.0] * 6):
        hear(learner, fixed(cycle_s, 20.0, begin_s), begin_s, begin_s + cycle_s, hz=10.0)
        begin_s += cycle_s
    hear(learner, fixed(60.0, 20.0, begin_s), begin_s, begin_s + 5.0, hz=10.0)
    found = learnt(learner, begin_s + 5.0)
    assert found is not None
    assert (found.cycles, found.cycle_s) == (6, pytest.approx(60.0, abs=0.01))


def test_what_was_learnt_is_forgotten_after_long_silence() -> None:
    learner = SignalLearner()
    hear(learner, fixed(60.0, 20.0), 0.0, 185.0)
    assert learnt(learner, 184.4 + 60.0 * 10) is not None, "ten cycles"
    assert learnt(learner, 184.6 + 60.0 * 10) is None


def test_reports_out_of_order_change_nothing() -> None:
    light, ordered, shuffled = fixed(60.0, 20.0), SignalLearner(), SignalLearner()
    hear(ordered, light, 0.0, 185.0)
    hear(shuffled, light, 0.0, 100.0)
    shuffled.take(SignalState(stamp_ns=ns(40.0), group_id="g", colour="green"))
    hear(shuffled, light, 100.0, 185.0)
    assert ordered.learnt(ns(185.0)) == shuffled.learnt(ns(185.0))


def test_two_lights_of_one_cycle_tell_the_offset_of_their_green_wave() -> None:
    learner = SignalLearner()
    for i in (1, 0):
        hear(learner, fixed(60.0, 20.0, 10.0 + 17.0 * i), 0.0, 260.0, group=f"g{i}")
    record = learner.record(ns(260.0), START_NS)
    assert list(record) == ["g0", "g1"]
    apart_s = record["g1"]["green_from_s"] - record["g0"]["green_from_s"]
    assert apart_s == pytest.approx(17.0, abs=0.5)
    assert record["g0"]["cycle_s"] == pytest.approx(60.0, abs=0.05)
    assert record["g0"] == {
        "cycle_s": 60.0,
        "green_from_s": pytest.approx(9.8, abs=0.11),
        "lasts_s": {"green": 20.0, "amber": 3.0, "red": 36.0, "red_amber": 1.0},
        "cycles": 4,
        "spread_s": 0.5,
    }


def test_of_more_than_a_thousand_groups_the_one_silent_for_longest_goes() -> None:
    learner = SignalLearner()
    hear(learner, fixed(60.0, 20.0, 30.0), -260.0, 0.0, group="g1")
    for i in range(1000):
        learner.take(SignalState(stamp_ns=ns(i), group_id=f"g{i}", colour="red"))
    learner.take(SignalState(stamp_ns=ns(2000), group_id="g0", colour="red"))
    learner.take(SignalState(stamp_ns=ns(2001), group_id="new", colour="red"))
    kept = {f"g{i}" for i in range(1000) if i != 1} | {"new"}
    assert ({one.group_id for one in learner.newest}, learner._cyclic) == (kept, {})


def test_of_a_light_without_a_cycle_little_is_kept() -> None:
    learner = SignalLearner()
    for number in range(200):
        colour: SignalColour = "red" if number % 2 else "amber"
        learner.take(SignalState(stamp_ns=ns(number), group_id="g", colour=colour))
    (group,) = learner._groups.values()
    assert len(group._changes) == 48


def test_futures_of_a_drive_are_told_what_was_learnt(tmp_path: Path) -> None:
    house = House(tmp_path)
    house.drive(20)
    now_s = (house.states[19].stamp_ns - START_NS) / 1e9
    light = fixed(60.0, 20.0)
    for time_s in np.arange(now_s - 190.0, now_s, 0.5).tolist():
        heard = SignalState(stamp_ns=ns(time_s), group_id="n1:g0", colour=light(time_s))
        house.bus.publish("signals", heard, vehicle="ego")
        house.settle()
    assert house.conductor.start_round()
    jobs = [r.message().decoded() for worker in house.workers for r in worker.take()]
    house.tables.close()
    assert jobs
    for job in jobs:
        (one,) = job.learnt_signals
        assert (one.group_id, one.cycles) == ("n1:g0", 3)
        assert one.cycle_s == pytest.approx(60.0, abs=0.1)
        assert heard_cycle(one, job.state.stamp_ns).colour_at(0.3) == light(now_s + 0.3)
