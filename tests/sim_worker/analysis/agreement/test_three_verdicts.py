"""Passed, failed or not observable: what a map and a source leave open fails nobody."""

from __future__ import annotations

from foretwin.sim_worker.analysis.agreement.tally import OUTCOMES, judged, outcome, tally
from tests.sim_worker.analysis.agreement.test_agreement import (
    STRAIGHT,
    along,
    case,
    failed,
    judge,
)
from tests.sim_worker.metrics.motions import Mover

COVERS = ("foretwin.sim_worker.analysis.agreement.judgement",)


def test_between_the_drawn_edge_and_the_farthest_nothing_can_be_said() -> None:
    """1.6 m off the road as the map draws it, within what its default widths leave open."""
    beside = along(Mover(-50.0, -4.7, 0.0, 5.0))
    inside = along(STRAIGHT)
    windows = [judged(*case(inside, driven, drawn=False)) for driven in (inside, beside, inside)]
    words = [one.verdicts.driven_word for one in windows]
    assert words == ["passed", "not_observable", "passed"]
    assert [one.outcome for one in windows] == ["agree_pass", "not_observable", "agree_pass"]
    assert failed(windows[1].verdicts.asked & ~windows[1].verdicts.observable) == ["drivable_area"]
    told = tally(windows, start_stamp_ns=0)
    assert told["driven"] == {"passed": 2, "failed": 0, "not_observable": 1}
    assert told["by_criterion"]["drivable_area"]["not_observable"] == 1
    assert told["by_criterion"]["drivable_area"]["not_asked"] == 0
    assert told["by_criterion"]["red_light"] == dict.fromkeys(OUTCOMES, 0) | {"not_asked": 3}
    assert sum(told["overall"].values()) == sum(told["by_criterion"]["comfort"].values()) == 3
    assert judge(simulated=inside, driven=beside).outcome == "too_optimistic"  # the very place


def test_who_leaves_the_road_farther_than_a_map_can_be_wrong_fails() -> None:
    leaves = along(STRAIGHT, left_mps=-2.0)
    one = judge(simulated=along(STRAIGHT), driven=leaves, drawn=False)
    assert failed(one.verdicts.driven.fails) == ["drivable_area"]
    assert one.outcome == "too_optimistic"


def test_what_the_map_does_not_hold_is_no_failure() -> None:
    """A yard, 20 m beside the road from the first instant on; a street closed to cars."""
    yard = along(Mover(-50.0, -25.0, 0.0, 5.0))
    _, in_yard = case(yard, yard, drawn=False)
    leaves = along(STRAIGHT, left_mps=-2.0)
    _, closed = case(along(STRAIGHT), leaves, drawn=False, closed_road=True)
    for evaluator in (in_yard, closed):
        assert "drivable_area" not in failed(evaluator.asked)


def test_states_too_rare_say_nothing_of_comfort() -> None:
    rare = judge(simulated=along(STRAIGHT), driven=along(STRAIGHT), state_period_s=1.0)
    assert "comfort" not in failed(rare.verdicts.asked)


def test_each_pair_of_verdicts_has_its_outcome() -> None:
    words = ("passed", "failed", "not_observable")
    found = {(a, b): outcome(a, b) for a in words for b in words}  # type: ignore[arg-type]
    assert set(found.values()) == set(OUTCOMES)
    assert found["failed", "passed"] == "too_pessimistic"
    assert found["passed", "failed"] == "too_optimistic"
    assert {found[key] for key in found if "not_observable" in key} == {"not_observable"}
