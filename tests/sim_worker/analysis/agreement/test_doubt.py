"""What is left open of where a car is, and how far that moves the edge of what fails."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from foretwin.sim_worker.analysis.agreement.criteria import CRITERIA, verdicts
from foretwin.sim_worker.analysis.agreement.doubt import (
    COVERAGE,
    STOP_LINE_M,
    PlaceDoubt,
    WorldDoubt,
    place_doubt,
)
from foretwin.sim_worker.analysis.agreement.window import Heard
from foretwin.sim_worker.metrics.road_edges import TAGGED_EDGE_M
from foretwin.sim_worker.vehicle.reference_points import box_centre_from_base_m
from foretwin.world_gen.driven.matching import MAP_ERROR_M
from tests.orchestrator.trip import town_world
from tests.sim_worker.analysis.agreement.test_agreement import STRAIGHT, TIME_S, along, case
from tests.sim_worker.metrics.junction import STOP_X
from tests.sim_worker.metrics.motions import LENGTH_M, VEHICLE, WIDTH_M, states_of_centre
from tests.sim_worker.metrics.test_road_edges import farther_m, mapped

COVERS = ("foretwin.sim_worker.analysis.agreement.stop_lines",)


def place(**known: Any) -> PlaceDoubt:
    window, _ = case(along(STRAIGHT), along(STRAIGHT), **known)
    return place_doubt(window, VEHICLE)


def test_an_antenna_that_nobody_placed_may_be_anywhere_on_the_car() -> None:
    known, unknown = place(), place(antenna_known=False)
    assert known.across_std_m == 0.0
    assert known.ahead_m.tolist() == [0.0]
    assert unknown.across_std_m == pytest.approx(WIDTH_M / math.sqrt(12.0))
    back = box_centre_from_base_m(VEHICLE)
    ahead_m = unknown.ahead_m
    assert ahead_m[0] == 0.0  # as it is taken to be
    assert ahead_m[1:].min() == pytest.approx(-back - 0.475 * LENGTH_M)
    assert ahead_m[1:].max() == pytest.approx(-back + 0.475 * LENGTH_M)


def farthest_m(doubt: WorldDoubt, one: PlaceDoubt) -> float:
    """How far beyond the drawn edge a car must be to be off the road for sure."""
    return farther_m(doubt.ground_at_most(one), doubt.drawn)


def test_what_is_left_open_adds_up_as_independent_errors_do() -> None:
    doubt = WorldDoubt(mapped(width="tagged"))
    std_m, across_m = 0.3, WIDTH_M / math.sqrt(12.0)
    square = TAGGED_EDGE_M**2 + COVERAGE**2 * (MAP_ERROR_M**2 + std_m**2 + across_m**2)
    rough = place(position_std_m=std_m, antenna_known=False)
    assert farthest_m(doubt, rough) == pytest.approx(math.sqrt(square), abs=0.05)
    assert farthest_m(doubt, place()) == pytest.approx(math.hypot(0.5, 2.4), abs=0.05)
    assert farthest_m(WorldDoubt(town_world("n4")), place()) == 0.0


def test_positions_of_one_roughness_share_their_ground() -> None:
    doubt = WorldDoubt(mapped())
    first, second, third = (place(position_std_m=std_m) for std_m in (0.11, 0.19, 0.21))
    assert doubt.ground_at_most(first) is doubt.ground_at_most(second)
    assert doubt.ground_at_most(third) is not doubt.ground_at_most(first)


def test_a_stop_line_may_lie_before_or_behind() -> None:
    at, least, most = WorldDoubt(mapped()).line_ahead_m("s", place())
    either = math.hypot(COVERAGE * MAP_ERROR_M, STOP_LINE_M)
    assert (at, least, most) == (0.0, pytest.approx(-either), pytest.approx(either))
    exact = WorldDoubt(town_world("n4")).line_ahead_m("s", place())
    assert exact == (0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("mps", "until_s", "word"),
    [
        (10.0, 8.0, "failed"),  # far beyond the line
        (10.0, 2.5, "not_observable"),  # stands 5 m beyond where the line is drawn
        (10.0, 0.5, "passed"),  # and 15 m before it
    ],
)
def test_a_red_light_is_run_where_the_line_is_crossed_wherever_it_lies(
    mps: float, until_s: float, word: str
) -> None:
    x = STOP_X - LENGTH_M / 2 - 20.0 + mps * np.minimum(TIME_S, until_s)
    driven = states_of_centre(np.column_stack([x, 0.0 * x - 1.5, 0.0 * x]), TIME_S)
    red = Heard(np.arange(-1, 10, dtype=np.int64) * 1_000_000_000, ("red",) * 11)
    window, evaluator = case(driven, driven, lights=True, heard={"ew": red}, drawn=False)
    found = verdicts(window, evaluator)
    at = CRITERIA.index("red_light")
    told = {"passed": found.driven.passes[at], "failed": found.driven.fails[at]}
    assert [name for name, is_so in told.items() if is_so] == [
        name for name in told if name == word
    ]
