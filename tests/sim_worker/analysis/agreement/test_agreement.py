"""Pass and fail, simulated and driven, and the gap that flips the answer, against closed forms."""

from __future__ import annotations

import math
from typing import Any

import msgspec
import numpy as np
import pytest

from foretwin.contracts.arrays import Array
from foretwin.contracts.provenance import Choice
from foretwin.contracts.world import DRAWN_ATTRIBUTION
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.sim_worker.analysis.agreement.criteria import (
    CRITERIA,
    LEAST_CLEARANCE_M,
    CriteriaEvaluator,
    verdicts,
)
from foretwin.sim_worker.analysis.agreement.doubt import WorldDoubt
from foretwin.sim_worker.analysis.agreement.flip import MOST_M, flips, gap_between, grown
from foretwin.sim_worker.analysis.agreement.tally import Judged, judged, tally
from foretwin.sim_worker.analysis.agreement.window import Heard, Users, Window
from foretwin.sim_worker.metrics.ground import TOLERANCE_M
from foretwin.sim_worker.metrics.route_rules import RouteRules
from tests.sim_worker.metrics.junction import STOP_X, junction
from tests.sim_worker.metrics.motions import (
    LENGTH_M,
    VEHICLE,
    WIDTH_M,
    Mover,
    states_of_centre,
    steady_poses,
    times,
)
from tests.sim_worker.places import straight_path

COVERS = (
    "foretwin.sim_worker.analysis.agreement.criteria",
    "foretwin.sim_worker.analysis.agreement.flip",
    "foretwin.sim_worker.analysis.agreement.tally",
    "foretwin.sim_worker.analysis.agreement.window",
)

TIME_S = times(8.0)
NOBODY = Users(np.zeros((81, 0, 3)), np.zeros((81, 0)), np.zeros((0, 2)))
FINE_M = MOST_M / 640
KNOWN_WELL: dict[str, Any] = {
    "known_users": True,
    "position_std_m": 0.0,
    "driven_std": np.full((81, 2), 0.001),
    "state_period_s": 0.02,
    "antenna_known": True,
    "closed_road": False,
}


def along(mover: Mover, *, left_mps: float = 0.0) -> Array:
    """States of a car that keeps its speed, and drifts to the left as it goes."""
    poses = steady_poses(mover, TIME_S)
    poses[:, 1] += left_mps * TIME_S
    return states_of_centre(poses, TIME_S)


def standing(x: float, y: float) -> Users:
    poses = np.tile([[[x, y, 0.0]]], (81, 1, 1))
    return Users(poses, np.zeros((81, 1)), np.array([[4.0, 2.0]]))


def case(
    simulated: Array,
    driven: Array,
    *,
    users: Users = NOBODY,
    driven_users: Users | None = None,
    lights: bool = False,
    sign: bool = False,
    heard: dict[str, Heard] | None = None,
    drawn: bool = True,
    red_after_stop: bool = False,
    **known: Any,
) -> tuple[Window, CriteriaEvaluator]:
    """A window in a World that is the very place, or, not `drawn`, a map of it."""
    world = junction(lights=lights, red_after_stop=red_after_stop)
    if drawn:
        world = msgspec.structs.replace(world, attribution=DRAWN_ATTRIBUTION)
    if sign:
        line = msgspec.structs.replace(world.stop_lines[0], control=Choice("stop", "tagged"))
        world = msgspec.structs.replace(world, stop_lines=(line,))
    path = straight_path().xy_m
    window = Window(
        round_id=1,
        stamp_ns=0,
        junction_id="j",
        world_id=world.id,
        time_s=TIME_S,
        simulated=simulated,
        simulated_users=users,
        driven=driven,
        driven_users=users if driven_users is None else driven_users,
        path_xy_m=path,
        heard=heard or {},
        **{**KNOWN_WELL, **known},
    )
    rules = RouteRules(world, FrenetPath(path))
    return window, CriteriaEvaluator(window, rules, WorldDoubt(world), VEHICLE)


def judge(**given: Any) -> Judged:
    return judged(*case(**given))


def failed(flags: Array) -> list[str]:
    return [name for name, flag in zip(CRITERIA, flags, strict=True) if flag]


def flip(one: Judged, direction: str) -> tuple[float | None, float | None]:
    (found,) = (f for f in one.flips if f.direction == direction)
    return found.factor, found.gap_m


STRAIGHT = Mover(-50.0, -1.5, 0.0, 5.0)


def test_a_drive_that_does_as_simulated_agrees() -> None:
    one = judge(simulated=along(STRAIGHT), driven=along(STRAIGHT))
    assert one.outcome == "agree_pass"
    assert flip(one, "both") == (None, None)  # no gap, no pattern to grow


def test_the_growth_that_touches_a_parked_car_is_that_of_the_closed_form() -> None:
    """Reality drifts to the left by 0.05 m/s; a parked car's side is 1.3 m from the car's."""
    side_m = 1.3
    parked = standing(-30.0, -1.5 + WIDTH_M / 2 + side_m + 1.0)
    one = judge(simulated=along(STRAIGHT), driven=along(STRAIGHT, left_mps=0.05), users=parked)
    assert one.outcome == "agree_pass"
    # The car passes until its rear has left the parked one's front: box middles 4 m + half apart.
    last_s = (-30.0 + 2.0 + LENGTH_M / 2 + 50.0) / 5.0
    needed = (side_m - LEAST_CLEARANCE_M) / (0.05 * last_s)
    factor, gap_m = flip(one, "across")
    assert factor is not None
    assert gap_m is not None
    # Turned a little as it drifts, and between two instants of 0.5 m: a tenth is close.
    assert factor == pytest.approx(needed, rel=0.1)
    assert gap_m == pytest.approx(factor * 0.05 * 8.0, rel=1e-6)


def test_the_growth_that_leaves_the_road_is_that_of_the_closed_form() -> None:
    """A steady offset to the right, without any turning, up to the road's edge."""
    driven = along(Mover(-50.0, -1.6, 0.0, 5.0))
    window, evaluator = case(along(STRAIGHT), driven)
    edge_m = next(
        y
        for y in np.arange(0.0, 6.0, 0.001)
        if not evaluator._doubt.drawn.contains(np.array([-30.0]), np.array([-1.5 - y]))[0]
    )
    assert edge_m > WIDTH_M / 2 + TOLERANCE_M
    one = judged(window, evaluator)
    factor, gap_m = flip(one, "across")
    assert gap_m == pytest.approx(edge_m - WIDTH_M / 2, abs=FINE_M + 0.002)
    assert factor == pytest.approx((edge_m - WIDTH_M / 2) / 0.1, rel=0.02)
    assert one.flips[1].fails == ("drivable_area",)


def test_a_car_ahead_is_reached_by_the_gap_along_the_way() -> None:
    """Reality is 0.5 m ahead throughout; the car stands 6 m short of another's bumper."""
    still = Mover(-50.0, -1.5)
    ahead = standing(-50.0 + LENGTH_M / 2 + 6.0 + 2.0, -1.5)
    one = judge(simulated=along(still), driven=along(Mover(-49.5, -1.5)), users=ahead)
    _, gap_m = flip(one, "along")
    assert gap_m == pytest.approx(6.0 - LEAST_CLEARANCE_M, abs=FINE_M + 1e-3)
    assert flip(one, "across") == (None, None)


def test_in_a_bend_a_gap_along_keeps_to_the_way() -> None:
    angle = 0.1 * TIME_S
    poses = np.column_stack([20.0 * np.sin(angle), 20.0 * (1.0 - np.cos(angle)), angle])
    states = states_of_centre(poses, TIME_S)
    late = states_of_centre(
        np.column_stack(
            [20.0 * np.sin(angle - 0.05), 20.0 * (1.0 - np.cos(angle - 0.05)), angle - 0.05]
        ),
        TIME_S,
    )
    gap = gap_between(states, late)
    assert np.abs(gap.across_m[10:]).max() < 0.05  # late is all that it is
    (moved,) = grown(states, gap, np.array([4.0]), "along")
    middle = slice(30, 60)
    radius = np.hypot(moved[middle, 0], moved[middle, 1] - 20.0)
    own = np.hypot(states[middle, 0], states[middle, 1] - 20.0)
    assert radius == pytest.approx(own, abs=0.02)
    turned = math.atan2(moved[30, 0], 20.0 - moved[30, 1])
    was = math.atan2(states[30, 0], 20.0 - states[30, 1])
    assert was - turned == pytest.approx(4.0 * 0.05, rel=0.05)


@pytest.mark.parametrize(
    ("simulated_y", "driven_y", "outcome"),
    [
        (-1.5, -1.5, "agree_pass"),
        (-1.5, -6.0, "too_optimistic"),
        (-6.0, -1.5, "too_pessimistic"),
        (-6.0, -6.0, "agree_fail"),
    ],
)
def test_the_four_outcomes(simulated_y: float, driven_y: float, outcome: str) -> None:
    one = judge(
        simulated=along(Mover(-50.0, simulated_y, 0.0, 5.0)),
        driven=along(Mover(-50.0, driven_y, 0.0, 5.0)),
    )
    assert one.outcome == outcome
    told = tally([one, one], start_stamp_ns=0)
    assert told["overall"][outcome] == 2
    assert told["by_criterion"]["drivable_area"][outcome] == 2
    assert told["by_criterion"]["comfort"]["agree_pass"] == 2


def test_a_line_crossed_at_a_red_that_was_heard() -> None:
    """Both cross 2 s after the start; the simulation saw amber coming, reality drove a second
    later, at red."""
    front = STOP_X - LENGTH_M / 2
    simulated = along(Mover(front - 10.0 * 2.0, -1.5, 0.0, 10.0))
    driven = along(Mover(front - 10.0 * 3.0, -1.5, 0.0, 10.0))
    stamps = np.arange(9, dtype=np.int64) * 1_000_000_000 - 500_000_000
    heard = Heard(stamps, ("green", "green", "amber", *(["red"] * 6)))  # type: ignore[arg-type]
    window, evaluator = case(simulated, driven, lights=True, heard={"ew": heard})
    found = verdicts(window, evaluator)
    assert failed(found.simulated.fails) == []
    assert failed(found.driven.fails) == ["red_light"]
    assert failed(case(simulated, driven, lights=True)[1].asked) == [
        "clearance",
        "drivable_area",
        "comfort",
    ]


def stops_and_goes_on() -> Array:
    """(N, 8) a car that stands 2 m before the line and then drives over it."""
    front = STOP_X - LENGTH_M / 2
    braking, leaving = np.clip(TIME_S, 0.0, 4.0), np.clip(TIME_S - 5.0, 0.0, None)
    x = front - 10.0 + 4.0 * braking - 0.5 * braking**2 + 0.75 * leaving**2
    assert x[-1] > front + 3.0
    return states_of_centre(np.column_stack([x, 0.0 * x - 1.5, 0.0 * x]), TIME_S)


@pytest.mark.parametrize(("may", "broken"), [(False, ["red_light"]), (True, [])])
def test_red_lets_go_who_has_stopped_where_the_law_does(may: bool, broken: list[str]) -> None:
    stamps = np.arange(9, dtype=np.int64) * 1_000_000_000 - 500_000_000
    heard = Heard(stamps, ("red",) * 9)
    rolls = along(Mover(STOP_X - LENGTH_M / 2 - 10.0, -1.5, 0.0, 4.0))
    given = case(stops_and_goes_on(), rolls, lights=True, heard={"ew": heard}, red_after_stop=may)
    found = verdicts(*given)
    assert failed(found.simulated.fails) == broken
    assert failed(found.driven.fails) == ["red_light"]


def test_a_stop_sign_wants_a_car_to_stand() -> None:
    rolls = along(Mover(STOP_X - LENGTH_M / 2 - 10.0, -1.5, 0.0, 4.0))
    found = verdicts(*case(stops_and_goes_on(), rolls, sign=True))
    assert failed(found.simulated.fails) == []
    assert failed(found.driven.fails) == ["stop_line"]


def test_the_gap_as_measured_leads_from_the_simulation_to_the_drive() -> None:
    """Through a bend, earlier and aside: once the gap is the drive."""
    angle = 0.08 * TIME_S + 0.004 * TIME_S**2
    poses = np.column_stack([25.0 * np.sin(angle), 25.0 * (1.0 - np.cos(angle)), angle])
    wide = np.column_stack([25.6 * np.sin(angle), 25.0 - 25.6 * np.cos(angle), angle])
    simulated, driven = states_of_centre(poses, TIME_S), states_of_centre(wide, TIME_S + 0.0)
    driven = driven[np.minimum(np.arange(81) + 4, 80)]
    (found,) = grown(simulated, gap_between(simulated, driven), np.array([1.0]), "both")
    assert found[:70, :2] == pytest.approx(driven[:70, :2], abs=0.05)
    assert found[:70, 2:4] == pytest.approx(driven[:70, 2:4], abs=0.02)


def test_what_reality_does_not_show_is_not_judged() -> None:
    off = along(Mover(-50.0, -6.0, 0.0, 5.0))
    window, evaluator = case(
        off, off, users=standing(-30.0, -6.0), known_users=False, position_std_m=2.0
    )
    found = verdicts(window, evaluator)
    assert failed(found.asked) == ["comfort"]
    assert (found.simulated_word, found.driven_word) == ("passed", "passed")
    gap = gap_between(window.simulated, along(Mover(-50.0, -5.0, 0.0, 5.0)))
    told = flips(evaluator, window.simulated, window.simulated_users, gap, found.asked, fails=False)
    assert [one.factor for one in told] == [None, None, None]


def test_a_corrected_world_changes_the_verdict() -> None:
    """The map had forgotten a stop sign: the same drive fails by the corrected one."""
    front = STOP_X - LENGTH_M / 2
    rolls = along(Mover(front - 15.0, -1.5, 0.0, 4.0))
    assert judge(simulated=rolls, driven=rolls).outcome == "agree_pass"
    corrected = judge(simulated=rolls, driven=rolls, sign=True)
    assert corrected.outcome == "agree_fail"
    assert failed(corrected.verdicts.driven.fails) == ["stop_line"]
